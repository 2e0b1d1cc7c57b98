"""Tables of the settings, versions and inputs of a run, from `run.json` and from the records."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from apo_bench.benchmark.report.tables.table import Table, TableColumn
from apo_bench.records.run.trials import Trials

_LONG = 400
"""Longer values are cut; `run.json` has them in full."""
_SHARED = ("schema", "fidelity", "grasp", "arm", "timestep_s", "clearance_mm")  # settings that a report states once


def list_run_facts(run: Mapping[str, Any], trials: Trials, hosts: Iterable[str]) -> dict[str, Table]:
    """Return tables of names and values by their headings; empty ones are left out."""
    seeds = trials.number("seed")
    tables: dict[str, Mapping[str, Any]] = {
        "Records": {
            **{name: sorted(trials.distinct(name)) for name in _SHARED},
            "seeds": f"{seeds.min():.0f} to {seeds.max():.0f}",
            "hosts": sorted(hosts),
            "config hashes": len(trials.distinct("config_hash")),
            "secret_seed": trials.find_secret_seed() or "none",
        },
        "run.json": {name: x for name, x in run.items() if not isinstance(x, dict | list) and name != "command"},
        **{f"grid {i}": grid for i, grid in enumerate(run.get("grids", ()), start=1)},
        **{name: value for name, value in run.items() if isinstance(value, dict)},
    }
    columns = (TableColumn("", "name", "name", words=True), TableColumn("", "value", "value", words=True))
    return {
        heading: Table([{"name": name, "value": format_setting(x)} for name, x in values.items()], columns)
        for heading, values in tables.items()
        if values
    }


def format_setting(value: Any) -> str:
    """Format a value for people: lists with commas, other values as JSON; long ones are cut."""
    text = value if isinstance(value, str) else json.dumps(value)
    if isinstance(value, list | tuple) and not any(isinstance(x, dict | list) for x in value):
        text = ", ".join(x if isinstance(x, str) else json.dumps(x) for x in value) or "–"
    return text if len(text) <= _LONG else text[:_LONG] + " …"
