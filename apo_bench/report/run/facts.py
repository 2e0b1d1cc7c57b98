"""What was run: specification, versions and command out of `run.json`, whatever of it there is."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from apo_bench.records import USUAL_LIMITS, Limits
from apo_bench.report.tables.table import Column, Table

_LONG = 400
"""Longer values are cut; they stand in the file."""
_MANY = 20
"""A table of more lines is folded."""


class FactTable(NamedTuple):
    """A table of what is said about a run."""

    name: str
    table: Table
    folded: bool


def scenario_files(run: Mapping[str, Any]) -> dict[str, str]:
    """Scenarios that were given as files: name -> path."""
    return dict(run.get("files") or {})


def limits_of(run: Mapping[str, Any]) -> Limits:
    """The limits that a sweep had when it was last started; the usual ones where it does not say."""
    limits = run.get("limits") or {}
    trial_s = limits.get("trial_s", USUAL_LIMITS.trial_s)
    return Limits(
        None if trial_s is None else float(trial_s), float(limits.get("corrector_s") or USUAL_LIMITS.corrector_s)
    )


def run_facts(run: Mapping[str, Any], rows: Mapping[str, Any]) -> list[FactTable]:
    """Tables of the specification and the versions.

    Args:
        rows: What the rows themselves say, by what it is called.
    """
    plain = {k: v for k, v in run.items() if not isinstance(v, (dict, list)) and k != "command"}
    facts = [FactTable("", _table("rows", rows), False)]
    facts += [FactTable("", _table("run", plain), False)] if plain else []
    for key, values in run.items():
        name = key.replace("_", " ")
        if isinstance(values, dict) and values:
            facts.append(FactTable(name, _table(name, values), len(values) > _MANY))
        elif isinstance(values, list) and values:
            facts.append(FactTable(name, _side_by_side(name, values), False))
    return facts


def _table(name: str, values: Mapping[str, Any]) -> Table:
    return Table(
        list(values.items()),
        (
            Column("", name, text=lambda item: item[0], words=True),
            Column("", "value", text=lambda item: value_words(item[1]), words=True),
        ),
    )


def _side_by_side(name: str, values: Sequence[Any]) -> Table:
    """One line per key."""
    records = [value if isinstance(value, dict) else {"": value} for value in values]

    def entry(record: Mapping[str, Any], number: int) -> Column:
        return Column("", str(number), text=lambda key: value_words(record[key]) if key in record else None, words=True)

    head = Column("", name, text=lambda key: key, words=True)
    keys = list(dict.fromkeys(key for record in records for key in record))
    return Table(keys, [head, *(entry(record, i) for i, record in enumerate(records, start=1))])


def value_words(value: Any) -> str:
    """A value as a person reads it: lists with commas, the rest as JSON."""
    text = value if isinstance(value, str) else json.dumps(value)
    if isinstance(value, (list, tuple)) and not any(isinstance(x, (dict, list)) for x in value):
        text = ", ".join(x if isinstance(x, str) else json.dumps(x) for x in value) or "–"
    return text if len(text) <= _LONG else text[:_LONG] + " …"
