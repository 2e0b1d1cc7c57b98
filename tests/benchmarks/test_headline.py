"""The committed headline can be had again: a fixed, paired part of it, trial by trial.

Where the physics runs to the same bits as where the rows were made, verdicts and numbers must be the same. Elsewhere
the counts must be plausible for the rates of the table.
"""

from __future__ import annotations

import json
import lzma
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from scipy.stats import binom

from apo_bench.records.settings import ROW, TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.arm import find_arm
from apo_bench.statistics.rates import tally
from apo_bench.sweeps.environment_lock import EnvironmentLock, versions
from apo_bench.sweeps.grid import Unit, load_all, units
from apo_bench.sweeps.sweep_file import read_sweep
from apo_bench.sweeps.worker import Worker
from apo_bench.trial.fingerprint import content_hash

KEPT = Path(__file__).parents[2] / "benchmarks" / "results" / "headline"
GRID = Path(__file__).parents[2] / "benchmarks" / "headline.toml"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
METHODS = ("none", "paper", "contact")
SEEDS = (0, 1, 2, 3)
LEVEL, CARELESS = 1.0, 1.0
SURPRISE = 1e-4
"""A count less likely than this under the rate of the table is a regression."""
NOT_COMPARED = ("spec_hash", "reached", "thresholds", "schema")
OTHERWISE = (
    *("success", "loose_success", "as_demonstrated_code", "failure_stage", "failure_code", "failure_operation"),
    *("sentence", "conditions", "worst_gap_mm", "worst_angle_deg", "least_overlap", "penetration_mm", "pushed_mm"),
)
"""What older rows say of the verdict that is now called `as_demonstrated`."""


@cache
def rows() -> list[dict[str, Any]]:
    found = [json.loads(line) for line in lzma.decompress((KEPT / "rows.jsonl.xz").read_bytes()).splitlines()]
    return [row if row["schema"] == ROW else {"as_demonstrated": row["success"], "salt": None} | row for row in found]


def fidelity() -> str:
    return str(json.loads((KEPT / "run.json").read_text())["grids"][0]["fidelity"])


def key(row: dict[str, Any]) -> tuple[Any, ...]:
    return row["scenario"], row["seed"], row["method"], row["level"], row["careless"]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_part_of_the_headline_runs_again_to_the_same_rows(name: str) -> None:
    kept, found = {key(row): row for row in rows()}, list[dict[str, Any]]()
    lock = EnvironmentLock({name: content_hash(load_scenario(name), name, find_arm("six_axis").mjcf)}, versions())
    worker = Worker(0, lock)
    for seed in SEEDS:
        trials = [
            TrialSettings(name, LEVEL, LEVEL, CARELESS, method=m, seed=seed, fidelity=fidelity()) for m in METHODS
        ]
        found += [said[0] for kind, *said in worker.run(Unit(tuple(trials))) if kind == "row"]
    for method in METHODS:
        mine = [row for row in found if row["method"] == method]
        theirs = [kept[key(row)] for row in mine]
        if mine[0]["peak_force_n"] == theirs[0]["peak_force_n"]:
            for ours, recorded in zip(mine, theirs, strict=True):
                left_out = NOT_COMPARED if recorded["schema"] == ROW else (*NOT_COMPARED, *OTHERWISE)
                same = {name: value for name, value in ours.items() if name not in left_out}
                assert same == {name: value for name, value in recorded.items() if name not in left_out}
        won, rate = sum(row["as_demonstrated"] for row in mine), rate_of(name, method)
        assert binom.cdf(won, len(SEEDS), rate) > SURPRISE, f"{method} succeeded only {won} times"
        assert binom.sf(won - 1, len(SEEDS), rate) > SURPRISE, f"{method} succeeded {won} times"


def rate_of(name: str, method: str) -> float:
    """What the table says, drawn towards a half by two trials, since a rate of 100 % forbids nothing but itself."""
    cell = [row for row in rows() if (row["scenario"], row["method"]) == (name, method)]
    counted = [row["as_demonstrated"] for row in cell if (row["level"], row["careless"]) == (LEVEL, CARELESS)]
    return (sum(counted) + 1) / (len(counted) + 2)


@pytest.mark.xfail(strict=True, reason="the rows are older than `search` and level 8 in headline.toml: make headline")
def test_the_headline_holds_every_trial_of_its_grid_once() -> None:
    ran = json.loads((KEPT / "run.json").read_text())
    grids = read_sweep(GRID, {"trials": ran["grids"][0]["trials"], "fidelity": fidelity()})
    asked = [trial for unit in units(grids, load_all(grids)) for trial in unit.trials]
    expected = [(t.scenario, t.seed, t.method, t.level_mm, t.careless) for t in asked]
    assert sorted(map(key, rows())) == sorted(expected)
    assert ran["rows"] == len(expected)


def test_the_table_is_that_of_the_rows() -> None:
    lines = (KEPT / "table.csv").read_text().splitlines()
    names = lines[0].split(",")
    told = [dict(zip(names, line.split(","), strict=False)) for line in lines[1:]]
    counted = {(t["scenario"], t["method"], float(t["level_mm"]), float(t["careless"])): t for t in told}
    for cell in tally(rows()):
        line = counted[cell.scenario, cell.method, cell.level, cell.careless]
        assert (int(line["trials"]), int(line["successes"])) == (cell.trials, cell.successes)
