"""The old rule of success against the new one: what a row would have been, and why it is another verdict today."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from apo_bench import Criteria, judge, load_scenario
from apo_bench.assembly import Reached, Snapshot, placements
from apo_bench.geometry import pose
from apo_bench.judging.contacts import FAULTS
from benchmarks import verdicts
from tests.scenes import mm

ROW = {"method": "search", "level": 1.0, "level_deg": 1.0, "careless": 0.0, "salt": None, "clearance_mm": 0.25}


def ended(name: str, seed: int, **moved: np.ndarray) -> dict[str, Any]:
    """A row of the judge of today, where parts lie elsewhere at the end than where they were put."""
    scenario = load_scenario(name)
    layout = verdicts.truth(name, seed, None, 0.25)
    history = placements(scenario.assembly, layout.start, layout.goals)
    final = {part: T @ moved.get(part, np.eye(4)) for part, T in history[-1].items()}
    after = tuple(Snapshot(dict(poses), 0.0, 0.0, 0.0, True) for poses in history)
    criteria = Criteria(scenario.thresholds, 0.25, scenario.success_means)
    found = judge(scenario.assembly, Reached(after, Snapshot(final, 0.0, 0.0, 0.0, True)), layout.goals, criteria)
    packed = {part: pose.pack(T) for part, T in final.items()}
    return {
        **ROW,
        "scenario": name,
        "seed": seed,
        "success": found.success,
        "conditions": dict(found.rests_on.conditions),
        "pushed_mm": found.rests_on.pushed_mm,
        "thresholds": asdict(scenario.thresholds),
        "reached": {part: [*(1e3 * p[:3]), *p[3:]] for part, p in packed.items()},
        "sentence": found.rests_on.why,
    }


def whole(name: str, T: np.ndarray) -> dict[str, Any]:
    """All that is loose, moved as one."""
    scenario = load_scenario(name)
    layout = verdicts.truth(name, 3, None, 0.25)
    final = placements(scenario.assembly, layout.start, layout.goals)[-1]
    loose = scenario.assembly.solids.keys() - scenario.assembly.fixed
    return ended(name, 3, **{part: pose.inverse(final[part]) @ T @ final[part] for part in loose})


NUDGED = whole("stick_in_tower", mm(1.25, 0, 0))
SUNK = ended("dovetail", 4, slide=mm(0, 0.4, -0.25))
SLID = ended("stick_in_tower", 3, stick=mm(1.5, 0, 0))


@pytest.mark.parametrize(
    ("row", "old", "new", "why"),
    [
        (ended("stick_in_tower", 3), True, True, ""),
        (NUDGED, False, True, "pushed: a corner moved by 1.25 mm in the room"),
        (SUNK, False, True, "gap: slide.lean_"),
        (SLID, False, False, ""),
        (ended("dovetail", 4, slide=mm(0, 0, 1.0)), False, False, ""),
    ],
)
def test_what_a_row_would_have_been(row: dict[str, Any], old: bool, new: bool, why: str) -> None:
    found = verdicts.compared(row)
    assert (found.old, found.new, found.why[: len(why)], bool(found.why)) == (old, new, why, old != new)


def test_a_row_that_only_the_new_rule_refused_would_be_told() -> None:
    """No row is like that: a part that slid moved in the room."""
    row = {**SLID, "pushed_mm": 0.7}
    assert verdicts.compared(row)[1:3] == (True, False)
    assert set(SLID["conditions"]) == set(FAULTS)


def test_cells_and_reasons_are_counted_and_listed() -> None:
    found = [verdicts.compared(row) for row in (NUDGED, SLID, SUNK)]
    counts = {cell[0]: n for cell, n in verdicts.cells(found).items()}
    assert counts == {
        "stick_in_tower": verdicts.Counts(trials=2, old=0, new=1, pushed=1, gap=0, refused=0),
        "dovetail": verdicts.Counts(trials=1, old=0, new=1, pushed=0, gap=1, refused=0),
    }


def test_the_contacts_that_may_be_farther_apart_are_those_of_the_dovetail() -> None:
    """All that the slide has with its bases."""
    for name, part in (("dovetail", "slide"), ("stick_in_tower", ""), ("pocket_table", "")):
        relations = load_scenario(name).assembly.relations()
        expected = {relation.contact for relation in relations if relation.contact.manipulated.part == part}
        assert {wide.contact for wide in verdicts.wide_contacts(name, 0, None, 0.25, 0.1)} == expected
