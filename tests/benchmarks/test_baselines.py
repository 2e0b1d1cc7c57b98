"""What each scenario asks for: the committed counts are those of the sweep file, and scenarios ask for enough."""

from __future__ import annotations

from pathlib import Path

from apo_bench import load_scenario
from apo_bench.scenario.file import scenario_names
from benchmarks.asked import asked_trials
from benchmarks.asks import BY_HEART, FEW, asks
from benchmarks.baselines import Count, Place, counted, kept

SWEEP = Path(__file__).parents[2] / "benchmarks" / "baselines.toml"
FOUR = ("peg_in_hole", "dovetail", "wedge_under_roof", "l_bracket_on_plate")
"""Scenarios that `snap` once solved in every trial."""


def test_every_seed_of_the_sweep_file_is_counted() -> None:
    assert {tuple(place): count.trials for place, count in kept().items()} == asked_trials([SWEEP], Place._fields)


def test_the_robot_can_do_every_scenario_and_contact_does() -> None:
    for place, count in kept().items():
        if place.method in ("oracle", "contact"):
            assert count.successes == count.trials, place


def test_memory_fails_in_eight_scenarios() -> None:
    fails = [p.scenario for p, count in kept().items() if p[1:] == ("nominal", 4.0) and count.rate <= BY_HEART]
    assert len(fails) >= 8


def test_three_of_four_that_snap_solved_need_more() -> None:
    found = kept()
    assert sum(found[Place(name, "snap", 2.0)].rate <= FEW for name in FOUR) >= 3


def test_a_card_says_what_the_counts_mean() -> None:
    counts = {place: Count(10, 10) for place in kept()}
    tower = load_scenario("stick_in_tower")
    assert "`snap` is enough" in asks(tower, counts)
    assert "Goals by heart are enough (10 of 10 at level 4): it stands on the plain table alone" in asks(tower, counts)
    counts |= {Place(tower.name, "snap", 2.0): Count(10, 5), Place(tower.name, "nominal", 4.0): Count(10, 2)}
    assert "It needs more than `snap` (5 of 10 at level 2)" in asks(tower, counts)
    assert "Goals by heart fail (2 of 10 at level 4)" in asks(tower, counts)
    assert set(scenario_names()) == {place.scenario for place in counts}


def test_trials_whose_demonstration_failed_do_not_count() -> None:
    row = {"scenario": "a", "method": "uncorrected", "noise_level": 2.0}
    rows = [{**row, "success": success} for success in (True, False, None)]
    assert counted(rows) == {Place("a", "uncorrected", 2.0): Count(2, 1)}
