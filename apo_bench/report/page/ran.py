"""What was run: specification, versions and command out of `run.json`, whatever of it there is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.report.page.markup import Html, Table, joined, tag

LONG = 400
"""Longer values are cut; they stand in the file."""


def scenario_files(run: Mapping[str, Any]) -> dict[str, str]:
    """Scenarios that were given as files: name -> path."""
    return dict(run.get("files") or {})


def limits_of(run: Mapping[str, Any]) -> Limits:
    """Those that a sweep had when it was last started; the usual ones where it does not say."""
    said = run.get("limits") or {}
    trial_s = said.get("trial_s", USUAL_LIMITS.trial_s)
    corrector_s = said.get("corrector_s") or USUAL_LIMITS.corrector_s
    return Limits(None if trial_s is None else float(trial_s), float(corrector_s))


def ran(run: Mapping[str, Any], rows: Mapping[str, Any]) -> Html:
    """Tables of the specification and the versions.

    Args:
        rows: What the rows themselves say, by what it is called.
    """
    made = [_table("rows", rows)]
    if not run:
        made.append(
            tag("p", "There is no run.json beside the rows, so versions and command are not known.", class_="none")
        )
        return joined(made)
    if run.get("command"):
        made.append(tag("p", tag("code", run["command"])))
    plain = {k: v for k, v in run.items() if not isinstance(v, (dict, list)) and k != "command"}
    if plain:
        made.append(_table("run", plain))
    for name, values in run.items():
        if isinstance(values, dict) and values:
            made.append(_folded(name, _table(name, values), len(values)))
        elif isinstance(values, list) and values:
            made.append(_folded(name, _beside(name, values), 1))
    return joined(made)


def _folded(name: str, table: Html, entries: int) -> Html:
    is_open = {"open": ""} if entries <= 20 else {}
    return tag("details", tag("summary", name.replace("_", " ")), table, **is_open)


def _beside(name: str, values: list[Any]) -> Html:
    """Entries side by side, one line per key."""
    given = [value if isinstance(value, dict) else {"": value} for value in values]
    keys = dict.fromkeys(key for value in given for key in value)
    rows: list[tuple[object, ...]] = [(key, *(words(v[key]) if key in v else None for v in given)) for key in keys]
    head = (name.replace("_", " "), *(str(i) for i in range(1, len(given) + 1)))
    return Table(head, rows, words=len(head)).html()


def _table(name: str, values: Mapping[str, Any]) -> Html:
    rows: list[tuple[object, ...]] = [(key, tag("span", words(value))) for key, value in values.items()]
    return Table((name.replace("_", " "), "value"), rows, words=2).html()


def words(value: Any) -> str:
    """A value as a person reads it: lists with commas, the rest as JSON."""
    if isinstance(value, str):
        said = value
    elif isinstance(value, (list, tuple)) and not any(isinstance(x, (dict, list)) for x in value):
        said = ", ".join(x if isinstance(x, str) else json.dumps(x) for x in value) or "–"
    else:
        said = json.dumps(value)
    return said if len(said) <= LONG else said[:LONG] + " …"
