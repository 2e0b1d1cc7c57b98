"""Other starts: a part that was seen turned comes right side up; no local minimum is taken for the nearest goals."""

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import correct
from apo_bench.assembly import build_contact_equations, find_faces_away, measure_largest_gap
from apo_bench.correction.solvers.compact import build_compact_equations
from apo_bench.correction.solvers.gauss_newton import find_nearest_poses
from apo_bench.correction.solvers.newton_descent import descend_to_nearest
from apo_bench.correction.solvers.whitened import factor_covariance, whiten_poses
from apo_bench.geometry import pose
from tests.correction.robust.test_robust import fixed_error_mm, look, shown


def turned(name, k, turn, seed=0):
    """Operation k seen turned in its own frame, [degrees]."""
    observation = look(name, seed)
    goals = np.array(observation.poses)
    goals[k] = goals[k] @ pose.at((0.0, 0.0, 0.0), turn)
    return replace(observation, poses=goals)


def length(observation, goals):
    return np.linalg.norm(whiten_poses(observation.poses, factor_covariance(observation.covariance), goals))


@pytest.mark.parametrize(("name", "k"), [("block_on_block", 1), ("pocket_table", 3)])
@pytest.mark.parametrize("turn", [[135, 0, 0], [0, 180, 0]])
def test_a_part_seen_upside_down_is_turned_back(name, k, turn):
    seen = turned(name, k, turn)
    found = correct(seen, "contact")
    assert found.ok
    assert f"seen turned: operation {k + 1} by 1" in found.sentence
    assert not found.test.passes
    assert fixed_error_mm(name, 0, found) < 3.0


@pytest.mark.parametrize("name", ["block_on_block", "pocket_table", "vanished_fixture"])
def test_far_away_no_correction_is_longer_than_the_one_to_the_truth(name):
    """At 40 mm and degrees half of the corrections that begin with what was seen are, or end nowhere."""
    _, layout, _ = shown(name, 3)
    for seen in (look(name, 3, 25.0), look(name, 3, 40.0)):
        found = correct(seen, "contact")
        assert found.ok
        assert length(seen, found.poses) <= length(seen, layout.poses)
        assert measure_largest_gap(seen.assembly, seen.start, found.poses) <= seen.gap_m


def test_where_contacts_bend_newton_ends_where_small_steps_would():
    """A cube seen upside down: each turn of it is about as far, so small steps shrink by a percent only."""
    seen = turned("block_on_block", 1, [180, 0, 0])
    L = factor_covariance(seen.covariance)
    goals = correct(seen, "contact").poses
    system = build_compact_equations(build_contact_equations(seen.assembly, seen.start, goals), 2)
    beside = goals.copy()
    beside[1] = beside[1] @ pose.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.2]))
    assert length(seen, beside) > length(seen, goals)
    there = descend_to_nearest(system, seen.poses, L, beside)
    assert length(seen, there) == pytest.approx(length(seen, goals), rel=1e-9)
    creeping = find_nearest_poses(system, seen.poses, L, None, whiten_poses(seen.poses, L, beside))
    assert not creeping.at_rest
    assert length(seen, creeping.poses) > length(seen, there)
    assert not find_faces_away(seen.assembly, seen.start, there).any()
