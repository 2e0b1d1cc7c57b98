"""How cameras fail is found and named; what repeats is no proof; noise that is larger than stated is noticed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import Demonstration, correct, draw_layout, load_scenario
from apo_bench.assembly import OutlierModel, compute_placements
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import pose
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.observing import observe
from apo_bench.perception.observation.wrong_contacts import make_contacts, replace_contacts
from apo_bench.trial.pose_error import goal_errors
from tests.correction.robust.test_reobservations import Again, at_the_same_place
from tests.correction.robust.test_robust import astray, fixed_error_mm, look, shown

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


def test_two_looks_that_repeat_an_error_are_no_proof():
    """Contacts contradict both, and are believed."""
    k = 1
    wrong = astray(look("carried_bridge", 2), k)
    second = at_the_same_place("carried_bridge", 2, 0)
    again = seen_at(second, k, wrong.poses[k] @ pose.exp(np.repeat([3e-4, 3e-3], 3)))
    for repeat, believed in ((0.8, False), (0.2, False)):
        model = OutlierModel(repeat=repeat)
        found = correct(replace(wrong, outliers=model), reobserve=Again(again))
        assert found.ok
        assert (k not in found.left_out) == believed
        assert found.dropped == ()
        assert fixed_error_mm("carried_bridge", 2, found) < 0.35


def test_noise_that_is_twice_what_is_stated_is_noticed_and_nothing_is_left_out():
    scales = []
    covered = []
    for seed in range(20):
        observation = look("vanished_fixture", seed, 2.0)
        stated = replace(observation, covariance=observation.covariance / 4.0)
        found = correct(stated)
        assert found.left_out == found.dropped == ()
        scales.append(found.noise_scale)
        covered.append(contains_truth(stated, found, shown("vanished_fixture", seed)[2].poses))
        if found.noise_scale > 1.5:
            assert "as noisy as stated" in found.sentence
    assert 1.7 < np.median(scales) < 2.3
    assert np.mean(covered) > 0.8


def test_a_hypothesis_at_which_the_solver_finds_no_number_is_none():
    """A contact too many in ten operations: one of the sets that are tried leads the compiled solver to no number."""
    scenario = load_scenario("gearbox")
    layout = draw_layout(scenario, np.random.default_rng([13, 7]), 0.0)
    first = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((10, 6, 6)))
    seen = make_noise("isotropic", NoiseLevel(1.0, 1.0))(scenario.assembly, first, np.random.default_rng([13, 8]))
    wrong = replace_contacts(seen, make_contacts("false-positive"), layout.poses, np.random.default_rng([13, 9]))
    found = correct(wrong)
    assert found.ok
    assert found.dropped


@pytest.mark.parametrize("seed", range(3))
def test_all_operations_may_be_false_together(seed):
    """Bracket and shaft are seen in each other's place: no set that leaves one of them believed agrees."""
    scenario = load_scenario("shaft_through_brackets")
    layout = draw_layout(scenario, np.random.default_rng(seed), 0.0)
    nothing = np.zeros((2, 6, 6))
    truth = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, nothing)
    observation = observe(truth, make_noise("isotropic", NoiseLevel(1.0, 1.0)), np.random.default_rng(seed))
    found = correct(replace(observation, poses=observation.poses[::-1]), "contact-robust")
    assert found.ok
    assert found.sentence.endswith("seen in each other's place: operation 1, 2")
    assert goal_errors(scenario.assembly, layout.start, layout.poses, found.poses)[0] < 0.01
