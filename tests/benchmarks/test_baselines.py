"""The committed counts are those of the sweep file, and scenarios ask for enough."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from apo_bench import load_scenario
from apo_bench.scenario.scenario_file import list_scenario_names
from benchmarks.baselines import COLUMNS, Place, difficulty, read_counts
from benchmarks.provenance import trials_of

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
    assert sum(p[1:] == ("nominal", 4.0) and count.rate <= 0.2 for p, count in found.items()) >= 8
    names = ("peg_in_hole", "dovetail", "wedge_under_roof", "l_bracket_on_plate")
    assert sum(found[Place(name, "snap", 2.0)].rate <= 0.5 for name in names) >= 3


def test_the_table_has_every_scenario_and_count() -> None:
    counts = read_counts()
    assert set(list_scenario_names()) == {place.scenario for place in counts}
    head, _, row = difficulty([load_scenario("peg_in_hole")], counts).splitlines()
    assert head.count("|") == row.count("|") == 2 + len(COLUMNS)
    assert [cell.strip() for cell in row.split("|")[2:-1]] == [
        str(counts[Place("peg_in_hole", *column)]) for column in COLUMNS
    ]
