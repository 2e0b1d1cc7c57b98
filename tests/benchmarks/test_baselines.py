"""The committed counts are those of the sweep file, and scenarios ask for enough."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from apo_bench import load_scenario
from apo_bench.benchmark.sweeps.sweep_file import read_sweep
from apo_bench.scenario.file import list_scenario_names
from benchmarks.baselines import FAILS, HALF, Count, Place, count, describe, read_counts
from benchmarks.provenance import share_of_sweep, trials_of

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_every_seed_of_the_sweep_file_is_counted() -> None:
    trials = trials_of(BENCHMARKS / "baselines.toml")
    asked = Counter(Place(trial.scenario, trial.method, trial.noise_mm) for trial in trials)
    assert {place: count.trials for place, count in read_counts().items()} == asked


def test_the_robot_can_do_every_scenario_and_contact_does() -> None:
    for place, found in read_counts().items():
        if place.method in ("oracle", "contact"):
            assert found.successes == found.trials, place


def test_nominal_poses_fail_in_eight_scenarios_and_snap_in_three_that_it_once_solved() -> None:
    found = read_counts()
    assert sum(p[1:] == ("nominal", 4.0) and count.rate <= FAILS for p, count in found.items()) >= 8
    names = ("peg_in_hole", "dovetail", "wedge_under_roof", "l_bracket_on_plate")
    assert sum(found[Place(name, "snap", 2.0)].rate <= HALF for name in names) >= 3


def test_a_task_sheet_says_what_the_counts_mean() -> None:
    counts = {place: Count(10, 10) for place in read_counts()}
    assert set(list_scenario_names()) == {place.scenario for place in counts}
    tower = load_scenario("stick_in_tower")
    assert "`snap` is enough" in describe(tower, counts)
    assert "Nominal poses are enough (10 of 10 at 4 mm): the assembly stands" in describe(tower, counts)
    counts |= {Place(tower.name, "snap", 2.0): Count(10, 5), Place(tower.name, "nominal", 4.0): Count(10, 2)}
    assert "`snap` is not enough (5 of 10 at 2 mm)" in describe(tower, counts)
    assert "Nominal poses fail (2 of 10 at 4 mm)" in describe(tower, counts)


def test_trials_whose_demonstration_failed_do_not_count() -> None:
    row = {"scenario": "a", "method": "uncorrected", "noise_mm": 2.0}
    rows = [{**row, "success": success} for success in (True, False, None)]
    assert count(rows) == {Place("a", "uncorrected", 2.0): Count(2, 1)}


@pytest.mark.parametrize("name", ["headline", "robust", "round", "gearbox", "arms", "robot_errors", "baselines"])
def test_every_sweep_has_the_baselines(name: str) -> None:
    methods = {method for grid in read_sweep(BENCHMARKS / f"{name}.toml") for method in grid.method}
    assert methods >= {"snap", "snap+spiral", "nominal"}


def test_a_trial_that_a_sweep_file_names_twice_counts_once(tmp_path: Path) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text(
        'scenario = ["block_on_block"]\nnoise_level = [1]\nhuman_error_scale = [0]\n'
        'method = ["uncorrected", "oracle"]\ntrials = 3\n[[also]]\nmethod = ["uncorrected"]\ntrials = 5\n'
    )
    assert share_of_sweep(2, path, path).startswith("The page holds 2 of the 8 trials of `benchmarks/sweep.toml`")
