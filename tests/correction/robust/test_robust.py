"""Outliers are found, left out and inferred; what is right is left alone."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import Demonstration, correct, draw_layout, load_scenario
from apo_bench.assembly import find_faces_away, measure_largest_gap
from apo_bench.correction.region import contains_truth
from apo_bench.geometry import pose
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.wrong_contacts import find_wrong_relation, make_contacts, replace_contacts
from apo_bench.trial.pose_error import measure_goal_errors
from tests.shipped import BOXES


@cache
def shown(name, seed=0):
    """The true layout, and what a careful human does, without a simulation."""
    scenario = load_scenario(name)
    layout = draw_layout(scenario, np.random.default_rng(seed), 0.0)
    nothing = np.zeros((len(scenario.assembly), 6, 6))
    return scenario, layout, Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, nothing)


def look(name, seed, noise_level=1.0):
    _, _, demonstration = shown(name, seed)
    rng = np.random.default_rng([seed, BOXES.index(name)])
    return make_noise("isotropic", NoiseLevel(noise_level, noise_level))(demonstration.assembly, demonstration, rng)


def astray(observation, k, seed=0):
    """Operation k seen somewhere else and turned anyhow."""
    rng = np.random.default_rng([seed, k])
    goals = np.array(observation.poses)
    q = rng.standard_normal(4)
    goals[k] = goals[k] @ pose.unpack(np.concatenate([rng.uniform(-0.5, 0.5, 3), q]))
    return replace(observation, poses=goals)


def fixed_error_mm(name, seed, correction):
    scenario, layout, _ = shown(name, seed)
    return measure_goal_errors(scenario.assembly, layout.start, layout.poses, correction.poses)[0]


@pytest.mark.parametrize("name", BOXES)
def test_without_outliers_it_is_contact(name):
    observation = look(name, 1)
    plain = correct(observation, "contact")
    robust = correct(observation, "contact-robust")
    assert plain.test.passes
    assert robust.poses.tolist() == plain.poses.tolist()
    assert (robust.status, robust.sentence) == ("converged", plain.sentence)
    # Noise that seems a little larger than stated makes regions larger, and nothing else.
    grown = 1.0 if robust.noise_scale == 1.0 else robust.noise_scale**2 * (1.0 + 2.0 / plain.test.freedom)
    assert robust.noise_scale < 1.5
    assert_allclose(robust.covariance, plain.covariance * grown, atol=1e-15)


def test_a_gross_outlier_is_named_and_what_contacts_fix_is_right():
    """Every operation in turn, in four scenarios; what only one contact tells of may look right elsewhere."""
    right = 0
    all_of_them = 0
    for name in ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table"):
        scenario, _, _ = shown(name, 2)
        for k in range(len(scenario.assembly)):
            observation = astray(look(name, 2), k)
            found = correct(observation, "contact-robust")
            assert found.ok
            assert measure_largest_gap(scenario.assembly, observation.start, found.poses) <= observation.gap_m
            assert not find_faces_away(scenario.assembly, observation.start, found.poses).any()
            all_of_them += 1
            right += found.left_out == (k,) and f"; left out what was seen of operation {k + 1}" in found.sentence
    assert right >= all_of_them - 1


@pytest.mark.parametrize("name", ["stick_in_tower", "vanished_fixture", "pocket_table"])
def test_what_was_missed_is_inferred(name):
    n = len(shown(name, 3)[0].assembly)
    seen = np.arange(n) != n - 2
    observation = replace(look(name, 3, 0.5), observed=seen)
    found = correct(observation, "contact-robust")
    assert found.ok
    assert found.left_out == (n - 2,)
    assert found.sentence.endswith(f"not seen: operation {n - 1}")
    assert correct(observation, "contact").status == "not_seen"


def test_what_contacts_fix_is_certain_and_what_they_leave_free_unknown():
    """The stick of the last operation, left out, may lie anywhere along the slots."""
    _, layout, _ = shown("vanished_fixture", 2)
    observation = astray(look("vanished_fixture", 2), 4)
    found = correct(observation, "contact-robust")
    assert found.left_out == (4,)
    deviation = np.sqrt(np.linalg.eigvalsh(found.covariance[4][:3, :3]))
    assert deviation[-1] == pytest.approx(0.05, rel=0.05)
    assert deviation[0] < 0.002
    assert contains_truth(observation, found, layout.poses)
    assert not contains_truth(observation, replace(found, assumed=None, hypotheses=()), layout.poses)


def test_a_relation_may_be_to_blame_in_place_of_an_observation():
    """One wall of the slot is 10 mm off its place: all other contacts of the stick agree with where it was seen."""
    observation = look("vanished_fixture", 5)
    wrong = replace_contacts(
        observation, make_contacts("face-offset:10mm"), shown("vanished_fixture", 5)[1].poses, np.random.default_rng(1)
    )
    found = correct(wrong, "contact-robust")
    assert found.ok
    assert found.dropped == (
        f"{find_wrong_relation(observation.assembly, wrong.assembly)}: stick.nz on castle1.sfl_shifted",
    )
    assert found.left_out == ()
    assert f"; left out {found.dropped[0]}" in found.sentence
    lonely = correct(astray(look("block_on_block", 5), 1), "contact-robust")
    assert lonely.left_out == (1,)
    assert "to blame" not in lonely.sentence


@pytest.mark.parametrize("seed", range(5, 9))
def test_one_wrong_contact_is_left_out_and_the_others_of_its_relation_are_kept(seed):
    """Without the whole relation the goal would be as far off as it was seen."""
    observation = look("pocket_table", seed)
    truth = shown("pocket_table", seed)[1].poses
    wrong = replace_contacts(observation, make_contacts("face-offset:5mm"), truth, np.random.default_rng(seed))
    found = correct(wrong, "contact-robust")
    assert found.ok
    assert found.left_out == ()
    (dropped,) = found.dropped
    assert dropped.startswith(f"{find_wrong_relation(observation.assembly, wrong.assembly)}: ")
    assert measure_goal_errors(observation.assembly, observation.start, truth, found.poses)[0] < 0.1


@pytest.mark.parametrize("seed", range(5, 9))
def test_a_pose_that_is_flipped_is_turned_back_and_no_relation_is_blamed(seed):
    observation = look("vanished_fixture", seed)
    truth = shown("vanished_fixture", seed)[1].poses
    goals = np.array(observation.poses)
    goals[1] = goals[1] @ pose.at((0.0, 0.0, 0.0), (0.0, 180.0, 0.0))
    found = correct(replace(observation, poses=goals), "contact-robust")
    assert found.ok
    assert found.dropped == ()
    assert found.left_out == ()
    assert "seen turned: operation 2" in found.sentence
    assert measure_goal_errors(observation.assembly, observation.start, truth, found.poses)[0] < 0.1
