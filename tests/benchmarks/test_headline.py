"""The committed headline holds what it says; that it can be had again, see `tests/trial/test_success_rate.py`."""

from __future__ import annotations

import json
import lzma
from functools import cache
from pathlib import Path
from typing import Any

from apo_bench.records.settings import ROW
from apo_bench.statistics.rates import tally
from apo_bench.sweeps.grid import load_all, units
from apo_bench.sweeps.sweep_file import read_sweep

KEPT = Path(__file__).parents[2] / "benchmarks" / "results" / "headline"
GRID = Path(__file__).parents[2] / "benchmarks" / "headline.toml"


@cache
def kept_rows() -> list[dict[str, Any]]:
    found = [json.loads(line) for line in lzma.decompress((KEPT / "rows.jsonl.xz").read_bytes()).splitlines()]
    return [row if row["schema"] == ROW else {"as_demonstrated": row["success"], "salt": None} | row for row in found]


def fidelity() -> str:
    return str(json.loads((KEPT / "run.json").read_text())["grids"][0]["fidelity"])


def key(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["scenario"], row["seed"], row["method"], row["level"], row["careless"]


def test_the_headline_holds_every_trial_of_its_grid_once() -> None:
    ran = json.loads((KEPT / "run.json").read_text())
    grids = read_sweep(GRID, {"trials": ran["grids"][0]["trials"], "fidelity": fidelity()})
    asked = [trial for unit in units(grids, load_all(grids)) for trial in unit.trials]
    expected = [(t.scenario, t.seed, t.method, t.level_mm, t.careless) for t in asked]
    assert sorted(map(key, kept_rows())) == sorted(expected)
    assert ran["rows"] == len(expected)


def test_the_table_is_that_of_the_rows() -> None:
    lines = (KEPT / "table.csv").read_text().splitlines()
    names = lines[0].split(",")
    told = [dict(zip(names, line.split(","), strict=False)) for line in lines[1:]]
    counted = {(t["scenario"], t["method"], float(t["level_mm"]), float(t["careless"])): t for t in told}
    for cell in tally(kept_rows()):
        line = counted[cell.scenario, cell.method, cell.level, cell.careless]
        assert (int(line["trials"]), int(line["successes"])) == (cell.trials, cell.successes)
