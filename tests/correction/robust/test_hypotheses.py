"""How cameras fail is found and named; what repeats is no proof; noise that is larger than stated is noticed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import correct
from apo_bench.assembly import OutlierModel, compute_placements
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import pose
from apo_bench.perception.observation.models.camera import Camera
from tests.correction.robust.test_robust import fixed_error_mm, look, shown

TOWER = "stick_in_tower"


def seen_at(observation, k, T):
    """An observation in which operation k is seen at another pose, with the error that it was seen with."""
    goals = np.array(observation.poses)
    goals[k] = T
    return replace(observation, poses=goals)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_that_is_seen_where_it_was_before_is_said_to_be(seed):
    name = "vanished_fixture"
    observation = look(name, seed)
    first = shown(name, seed)[2]
    before = (first.start, *compute_placements(first.assembly, first.start, first.poses))[4]["stick"]
    off = pose.exp(np.repeat([1e-3, np.radians(1.0)], 3) * np.random.default_rng(seed).standard_normal(6))
    found = correct(seen_at(observation, 4, before @ off))
    assert found.left_out == (4,)
    assert found.sentence.endswith("; seen where the part was before: operation 5")
    assert fixed_error_mm(name, seed, found) < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_two_like_parts_that_are_seen_in_each_others_place_are_changed_back(seed):
    observation = look(TOWER, seed)
    found = correct(replace(observation, poses=observation.poses[[1, 0, 2]]))
    assert "seen in each other's place: operation 1, 2" in found.sentence
    assert found.left_out == found.dropped == ()
    assert fixed_error_mm(TOWER, seed, found) < 0.1
    # What is free of the contacts is as it was seen, of the right part.
    plain = correct(observation, "contact")
    assert_allclose(found.poses, plain.poses, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_seen_too_near_says_the_rest_all_the_same(seed):
    """Along the ray nothing is known; across it and of the turn all that was seen is."""
    camera = Camera()
    observation = look(TOWER, seed)
    goals = np.array(observation.poses)
    goals[0, :3, 3] += 0.04 * camera.rays(goals)[0]
    told = OutlierModel(camera_m=tuple(camera.T_world_camera[:3, 3].tolist()))
    found = correct(replace(observation, poses=goals, outliers=told))
    assert found.sentence.endswith("; seen too near or too far: operation 1")
    assert found.left_out == ()
    truth = shown(TOWER, seed)[2].poses
    assert fixed_error_mm(TOWER, seed, found) < 0.1
    assert contains_truth(observation, found, truth, 0.999)


@pytest.mark.parametrize("seed", range(3))
def test_operations_in_a_row_that_are_displaced_alike_are_displaced_together(seed):
    """What they say of each other is believed; where they all are is inferred from the others."""
    name = "vanished_fixture"
    observation = look(name, seed)
    E = pose.exp([0.03, -0.02, 0.015, 0.05, 0.06, -0.04])
    goals = np.array(observation.poses)
    middle = pose.at(goals[2:, :3, 3].mean(axis=0))
    goals[2:] = middle @ E @ pose.inverse(middle) @ goals[2:]
    found = correct(replace(observation, poses=goals))
    assert "seen displaced together: operation 3, 4, 5" in found.sentence
    assert found.left_out == found.dropped == ()
