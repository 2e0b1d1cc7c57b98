"""No corrector of the package calls goals right at which faces that touch look the same way."""

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import correct, correct_many
from apo_bench.assembly import compute_placements, find_faces_away
from apo_bench.assembly.contact_kinds import OPPOSING
from apo_bench.correction.contact.contact import contact
from apo_bench.geometry import pose
from tests.correction.robust.test_robust import look, shown

TURNS = [[135, 0, 0], [180, 0, 0], [0, 135, 0], [0, 180, 0], [180, 0, 90], [0, 180, 90]]


def turned(name, k, turn, seed=0):
    """Operation k seen turned in its own frame, [degrees]."""
    observation = look(name, seed)
    goals = np.array(observation.poses)
    goals[k] = goals[k] @ pose.at((0.0, 0.0, 0.0), turn)
    return replace(observation, poses=goals)


@pytest.mark.parametrize("name", ["carried_bridge", "pocket_table"])
def test_faces_look_at_each_other_at_the_truth_and_one_turned_over_does_not(name):
    scenario, layout, _ = shown(name)
    assembly = scenario.assembly
    assert not find_faces_away(assembly, layout.start, layout.poses).any()
    goals = np.array(layout.poses)
    goals[-1] = goals[-1] @ pose.at((0.0, 0.0, 0.0), (180.0, 0.0, 0.0))
    both = find_faces_away(assembly, layout.start, np.array([layout.poses, goals]))
    assert not both[0].any()
    for k, (operation, at) in enumerate(
        zip(assembly.operations, compute_placements(assembly, layout.start, goals), strict=True)
    ):
        for m, e in operation.contacts:
            i = next(i for i, r in enumerate(assembly.relations()) if r.contact == (m, e) and r.made == k)
            cosine = (at[m.part][:3, :3] @ assembly.face(m).normal) @ (at[e.part][:3, :3] @ assembly.face(e).normal)
            assert both[1, i] == (cosine > OPPOSING)


@pytest.mark.parametrize("name", ["carried_bridge", "pocket_table"])
def test_nothing_converges_where_a_part_was_seen_turned_over(name):
    """Operations and turns in turn; what the solver turns back is right, what it leaves upside down is said."""
    scenario, layout, _ = shown(name)
    seen = [turned(name, k, turn) for k in range(len(scenario.assembly)) for turn in TURNS]
    for made in correct_many(seen[::7], contact):
        assert not made.ok or not find_faces_away(scenario.assembly, layout.start, made.poses).any()
    for corrector in ("paper", "contact-drop", "snap", "contact-robust"):
        for one in seen[::13]:
            made = correct(one, corrector)
            kept = scenario.assembly.without(made.dropped)
            assert not made.ok or not find_faces_away(scenario.assembly, layout.start, made.poses)[kept].any()
