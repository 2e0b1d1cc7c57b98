"""A robot that probes: where it touches, what laying flat measures, and that it uses touches only."""

from functools import cache

import numpy as np
import pytest

from apo_bench import Plan, build_scene, load_scenario
from apo_bench.geometry import pose
from apo_bench.records import parse_ft_noise
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.probing.places import floor_places
from apo_bench.simulation.execution.probing.state import PADS, ProbingState, touch_guard
from apo_bench.simulation.execution.probing.touching import probe_fixed_parts
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.sag import compute_sag_per_metre
from apo_bench.simulation.robot.wrist import compute_low_pass_gain, filter_noise
from apo_bench.trial.run import probing_config
from apo_bench.trial.trial_stages import replay_and_judge, robot_error_of, simulate_demonstration

STATED = "hand_eye:0.5/0.1+tool:0.5"


@cache
def scene(name):
    return build_scene(load_scenario(name))


@cache
def plan(name):
    truth = simulate_demonstration(scene(name), 0.0, 1).layout
    return Plan(scene(name).scenario.assembly, truth.start, truth.poses)


def drawn(name, kinds, seed=3):
    return robot_error_of(
        kinds, scene(name), lambda which, shape: np.random.default_rng([seed, which]).standard_normal(shape)
    )


def found_out(name, error, parts_at=None, stated=STATED):
    """What a robot believes once it has touched what is fixed."""
    start = plan(name).start if parts_at is None else parts_at
    robot = Robot(scene(name), start, None, "near-contact", error)
    probing = ProbingState(
        probing_config(plan(name), scene(name), stated, (5,), "ideal"), plan(name), scene(name), error
    )
    robot.wait(0.05)
    robot.level()
    probe_fixed_parts(robot, probing)
    return probing.estimate


@pytest.mark.parametrize("name", ["stick_in_tower", "peg_in_hole", "pocket_table"])
def test_the_floor_is_touched_at_three_places_around_the_goals(name):
    places = floor_places(plan(name), scene(name))
    middle = plan(name).target_poses[:, :2, 3].mean(axis=0)
    angles = [np.arctan2(*(place.T_world_tip[:2, 3] - middle)[::-1]) for place in places]
    assert len(places) == 3
    # every third of a turn, so the middle is inside
    assert np.diff(sorted([*angles, min(angles) + 2 * np.pi])).max() < np.pi
    for place in places:
        touched = pose.apply(place.T_world_tip, place.patch).mean(axis=0)
        assert place.normal @ touched - place.offset == pytest.approx(0.004, abs=1e-9)


def test_the_noisiest_sensor_ends_a_touch_before_it_is_a_collision():
    felt = filter_noise(parse_ft_noise("10/5"), compute_low_pass_gain())
    assert 10.0 < touch_guard(felt.force_n) < 0.7 * 20.0


def test_a_round_peg_that_slipped_and_tipped_in_the_hand_is_known_by_its_side():
    """Turned by 1.7 degrees between the pads: laid on its small foot it is known to a degree, by a wall much better."""
    name = "peg_in_hole"
    slips = np.tile(np.eye(4), (2, 1, 1))
    slips[1] = pose.at((0.0, 0.0006, 0.0), (1.7, 0.0, 0.0))
    error = RobotError(np.eye(4), np.zeros(6), np.eye(4), slips)
    probing = probing_config(plan(name), scene(name), "in_hand:0.5/1", (6,))
    felt = replay_and_judge(
        plan(name),
        scene(name),
        plan(name).target_poses,
        config=ExecutionConfig("near-contact", robot_error=error, probing=probing),
    )
    assert felt.verdict.success
    assert (felt.result.probing.touches, felt.result.probing.refused) == (15, 0)


def test_the_estimate_depends_on_touches_only():
    """A base that is off, and a world that stands off the other way: motions and estimate are the same."""
    E = pose.at((0.0008, -0.0006, 0.0), (0.0, 0.0, 0.15))
    n = len(plan("peg_in_hole").assembly)
    error = RobotError(E, np.zeros(6), np.eye(4), np.tile(np.eye(4), (n, 1, 1)))
    moved = {part: pose.inverse(E) @ T for part, T in plan("peg_in_hole").start.items()}
    one = found_out("peg_in_hole", error)
    other = found_out("peg_in_hole", None, moved)
    assert len(one.touches) == len(other.touches) == 9
    for a, b in zip(one.touches, other.touches, strict=True):
        assert np.abs(a.T_world_tip - b.T_world_tip).max() < 2e-5
    assert one.mean == pytest.approx(other.mean, abs=3e-5)


def test_an_arm_that_hangs_lower_than_its_command_rests_on_nothing():
    """Half of its weight is not compensated: its encoders show that, and it carries its weight after a touch, too."""
    model = scene("stick_in_tower").work.model
    usual = model.body_gravcomp.copy()
    model.body_gravcomp[:] = 0.5 * usual
    try:
        found = found_out("stick_in_tower", None)
    finally:
        model.body_gravcomp[:] = usual
    assert len(found.touches) == 3
    assert found.mean == pytest.approx(0.0, abs=3e-5)


def test_a_drifting_sensor_is_tared_before_each_touch():
    error = drawn("stick_in_tower", "ft_drift:20")
    assert np.linalg.norm(error.ft_drift[:3]) > 0.2  # 2 N in 10 s
    found = found_out("stick_in_tower", error)
    assert len(found.touches) == 3
    assert found.mean == pytest.approx(0.0, abs=3e-5)


def test_a_stated_sag_is_felt_on_the_floor():
    error = drawn("stick_in_tower", "sag:1")
    found = found_out("stick_in_tower", error, stated="sag:1")
    assert found.sag * compute_sag_per_metre(scene("stick_in_tower")) == pytest.approx(error.sag, rel=0.05)


def test_pads_of_unequal_fingers_are_felt_around_a_fixed_part():
    error = drawn("peg_in_hole", "finger:1")
    found = found_out("peg_in_hole", error, stated="finger:1")
    assert found.held(PADS, np.eye(4))[0, 3] == pytest.approx(error.finger / 2, abs=3e-5)


def test_probing_succeeds_where_a_blind_robot_fails():
    name = "stick_in_tower"
    error = drawn(name, "hand_eye:0.5/0.1+in_hand:0.3/1", 4)
    goals = plan(name).target_poses
    blind = replay_and_judge(plan(name), scene(name), goals, config=ExecutionConfig("near-contact", robot_error=error))
    probing = probing_config(plan(name), scene(name), "hand_eye:0.5/0.1+in_hand:0.3/1", (6,))
    felt = replay_and_judge(
        plan(name), scene(name), goals, config=ExecutionConfig("near-contact", robot_error=error, probing=probing)
    )
    assert not blind.verdict.success
    assert felt.verdict.success
    assert felt.result.probing.touches == 7
    assert felt.result.probing.refused == 0
