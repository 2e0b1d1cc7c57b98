"""How trials ended, in a few words, and which failures a report shows as pictures; others can draw them.

What was run: specification, versions and command out of `run.json`, whatever of it there is.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.io import grouped
from apo_bench.records import USUAL_LIMITS, Limits, Row, Salt
from apo_bench.records.run.replay_command import Files, left_out, own_code
from apo_bench.report.tables.table import Column, Table
from apo_bench.statistics import NOT_EXECUTED, rank


class FailurePicture(NamedTuple):
    """Of one trial."""

    row: Row
    jpeg: bytes
    words: str
    """How it was made."""


Draw = Callable[..., tuple[list[FailurePicture], list[str]]]
"""Runs failed trials again and draws them, as `failure_pictures` of `apo_bench.show` does; the sentences say what could
not be drawn."""


def verdict(row: Row) -> str:
    """How a trial ended, in a word or two."""
    if row["success"] is None:
        return "excluded"
    if row["success"]:
        return "right" if row["as_demonstrated"] else "right, not as demonstrated"
    return "loosely right" if row["loose_success"] else "failed"


def why(row: Row) -> str:
    """`attach: force_stop, operation 3`; nothing where nothing failed."""
    if row["failure_stage"] is None:
        return ""
    where = "" if row.get("failure_operation") is None else f", operation {row['failure_operation']}"
    return f"{row['failure_stage']}: {row['failure_code']}{where}"


def draw_failures(
    rows: Sequence[Row], folder: Path, files: Files, most: int, draw: Draw | None, salt: Salt | None, trust_code: bool
) -> tuple[list[FailurePicture], list[str]]:
    """So many pictures at most, and sentences on those that are missing.

    Args:
        trust_code: Run also trials that name code that does not come with the package.
    """
    if not most or draw is None:
        return [], []
    pictures, missing = draw(sample(rows, most, trust_code=trust_code), folder, files, salt, trust_code=trust_code)
    without = "" if trust_code else left_out(rows)
    return pictures, [*missing, *([without] if without else [])]


def sample(rows: Iterable[Row], most: int, *, trust_code: bool = False) -> list[Row]:
    """Failures to be drawn: one for each way of failing, the most frequent first, methods and scenarios varied.

    The same rows, in any order, give the same sample. Trials that were not carried out have nothing to be seen.

    Args:
        trust_code: Also trials that name code of somebody's own.
    """
    failed = (row for row in rows if row["success"] is False and row["level"] is not None and row.get("sim_seconds"))
    ways = grouped(
        ((str(row["failure_stage"]), str(row["failure_code"])), row)
        for row in failed
        if row["failure_stage"] not in NOT_EXECUTED and (trust_code or not own_code(row))
    )
    chosen: list[Row] = []
    for _, alike in sorted(ways.items(), key=lambda way: (-len(way[1]), way[0]))[:most]:
        chosen.append(_least_shown(sorted(alike, key=_order), chosen))
    return chosen


def _order(row: Row) -> tuple[Any, ...]:
    where = (row["scenario"], row["clearance_mm"], row["noise"], row["relations"], row["careless"], row["level"])
    return (row["seed"], rank(row["method"]) == 1, rank(row["method"]), row["method"], where)


def _least_shown(alike: Sequence[Row], chosen: Sequence[Row]) -> Row:
    """The first one of a method and scenario that was chosen least."""
    shown = Counter(x for row in chosen for x in (("method", row["method"]), ("scenario", row["scenario"])))
    return min(alike, key=lambda row: shown["method", row["method"]] + shown["scenario", row["scenario"]])


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
    return Limits(None if trial_s is None else float(trial_s))


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
