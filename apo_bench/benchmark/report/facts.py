"""What was run: specification, versions and command from `run.json`, and what the trials say themselves."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from apo_bench.benchmark.report.tables.table import Column, Table
from apo_bench.records.run.trials import Trials

_LONG = 400
"""Longer values are cut; they stand in the file."""


def run_facts(run: Mapping[str, Any], trials: Trials, hosts: Iterable[str]) -> dict[str, Table]:
    """Tables by their headings; one line for each value of a setting that has several by name."""
    shared = ("schema", "fidelity", "grasp", "arm", "timestep_s", "clearance_mm")
    seeds = trials.number("seed")
    said: dict[str, Any] = {name: sorted(trials.distinct(name)) for name in shared}
    said |= {"seeds": f"{seeds.min():.0f} to {seeds.max():.0f}", "hosts": sorted(hosts)}
    said |= {"specifications": len(trials.distinct("config_hash")), "secret_seed": trials.find_secret_seed() or "none"}
    tables: dict[str, Any] = {"What the rows say": said, "What run.json says": {}}
    for key, value in run.items():
        if isinstance(value, dict):
            tables[key] = value
        elif isinstance(value, list):
            tables |= {f"{key} {i}": each for i, each in enumerate(value, start=1) if isinstance(each, dict)}
        elif key != "command":
            tables["What run.json says"][key] = value
    return {name: _table(values) for name, values in tables.items() if values}


def _table(values: Mapping[str, Any]) -> Table:
    lines = [{"name": name, "value": value_words(value)} for name, value in values.items()]
    return Table(lines, (Column("", "name", "name", words=True), Column("", "value", "value", words=True)))


def value_words(value: Any) -> str:
    """A value as a person reads it: lists with commas, the rest as JSON."""
    text = value if isinstance(value, str) else json.dumps(value)
    if isinstance(value, (list, tuple)) and not any(isinstance(x, (dict, list)) for x in value):
        text = ", ".join(x if isinstance(x, str) else json.dumps(x) for x in value) or "–"
    return text if len(text) <= _LONG else text[:_LONG] + " …"
