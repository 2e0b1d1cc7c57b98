"""The plan check of a described arm precedes its motion and enters the prediction."""

import numpy as np
import pytest

from apo_bench import Plan, build_scene, draw_layout, load_scenario
from apo_bench.geometry import pose
from apo_bench.planning.prediction.first_failure import Prediction, predict_failure
from apo_bench.simulation.arm_checks.plan_check import arm_moves


def test_a_panda_that_cannot_hold_its_tolerance_is_predicted_to_fail() -> None:
    """The replay is stopped by force at this operation with 0.05 mm, and fits with the 0.25 mm of the scenario."""
    scene = build_scene(load_scenario("shaft_through_brackets"), arm="panda_primitive")
    scenario = scene.scenario
    layout = draw_layout(scenario, np.random.default_rng([0, 0]), scene.clearance_mm)
    plan = Plan(scenario.assembly, layout.start, layout.poses)
    moves = arm_moves(plan, scene)

    def said(clearance_mm: float) -> Prediction:
        return predict_failure(plan, clearance_mm, scenario.thresholds, scenario.attach, moves)

    assert said(0.25).code == "ok"
    tight = said(0.05)
    assert (tight.operation, tight.code) == (1, "tip_error")
    assert tight.size_mm == pytest.approx(0.09, abs=0.03)
    assert all(move.sag[2, 3] < 0.0 and (move.margin_deg or 0.0) > 5.0 for move in moves)
    far = pose.at((0.9, 0.0, 0.0), (0.0, 0.0, 0.0))
    away = Plan(scenario.assembly, {part: far @ T for part, T in plan.start.items()}, far @ plan.target_poses)
    refused = predict_failure(away, 0.25, scenario.thresholds, scenario.attach, arm_moves(away, scene))
    assert (refused.operation, refused.code) == (0, "unreachable_start")
    raised = {**plan.start, "table": pose.at((0.0, 0.0, 0.06), (0.0, 0.0, 0.0)) @ plan.start["table"]}
    first = arm_moves(Plan(scenario.assembly, raised, plan.target_poses), scene)[0]
    assert first.collides_with == "table"
    assert first.collision_mm > 1.0
