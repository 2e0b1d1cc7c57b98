"""A robot with errors brings parts to where geometry predicts it, as physics shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from apo_bench import build_scene, load_scenario
from apo_bench.assembly import Outcome, Plan
from apo_bench.geometry import pose
from apo_bench.scenario import draw_layout
from apo_bench.simulation.execution import ExecutionConfig, plan_moves
from apo_bench.simulation.robot import translate
from apo_bench.simulation.task.start import prepare_start
from apo_bench.simulation.task.tip_control import TipControl
from apo_bench.trial.robot_draws import KEPT, bring, list_unit_errors, twist_in_open_hand
from apo_bench.trial.trial_stages import LAYOUT, draw_robot_error, stream


def test_a_robot_with_a_tilted_hand_eye_error_brings_a_part_to_where_it_is_predicted() -> None:
    """It would be 0.7 mm off if closing pads turned the part to them about both of their axes."""
    trial = 8000
    scene = build_scene(load_scenario("stick_in_tower"))
    layout = draw_layout(scene.scenario, stream(trial, LAYOUT), scene.clearance_mm)
    plan = Plan(scene.scenario.assembly, scene.scenario.start, layout.poses)
    last = plan_moves(plan, scene, True)[-1]
    t = last.transfer
    move = last._replace(transfer=replace(t, T_world_goal=translate(t.T_world_goal, t.into.direction, -t.begins)))
    right = draw_robot_error("hand_eye:0/0.001", scene, trial)  # almost none
    wrong = draw_robot_error("hand_eye:0/0.1", scene, trial)
    true, predicted = [], []
    for error in (right, wrong):
        start = prepare_start(plan, scene, 2, ExecutionConfig(robot_error=error), ("ideal", (trial,)))
        assert not isinstance(start, Outcome)
        true.append(TipControl(scene, start, np.random.default_rng(0)).poses()[t.part])
        predicted.append(bring(scene, move, error, KEPT * twist_in_open_hand(scene, t, error, plan.start[t.part])))
    moved, expected = (pose.log(pose.inverse(before) @ after) for before, after in (true, predicted))
    assert np.linalg.norm(expected[:3]) > 2e-4
    np.testing.assert_allclose(moved[:3], expected[:3], atol=6e-5)  # closing fingers turn it by some 0.02 degrees
    np.testing.assert_allclose(moved[3:], expected[3:], atol=np.radians(0.03))


def test_unit_errors_are_those_that_a_robot_error_names() -> None:
    scene = build_scene(load_scenario("block_on_block"))
    assert list_unit_errors("none", scene) == []
    shifts = [pose.log(each.hand_eye) for each in list_unit_errors("hand_eye:0.5", scene)]
    np.testing.assert_allclose(np.sort(np.abs(shifts), axis=1)[:, -2:], [[0.0, 5e-4]] * 3, atol=1e-12)
    assert len(list_unit_errors("tool:1+finger:0.5", scene)) == 4
