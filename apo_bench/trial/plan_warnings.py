"""Warnings about a plan, as sentences for commands."""

import numpy as np

from apo_bench.assembly import Correction, Plan
from apo_bench.planning.prediction.first_failure import predict_failure
from apo_bench.scenario import Scenario, place_layout
from apo_bench.simulation.arm_checks.plan_check import arm_moves
from apo_bench.simulation.scene import build_scene


def describe_plan_warnings(scenario: Scenario, plan: Plan, correction: Correction | None) -> str:
    """The warnings about a plan in one sentence; empty if there are none.

    For example: `the stated noise does not explain the correction (p = 0.0004); predicted: operation 3 (stick) will
    fail: ..`.

    Args:
        correction: What the corrector returned; None without a corrector.
    """
    sentences = []
    test = None if correction is None else correction.test_after or correction.test
    if test is not None and not test.passes:
        sentences.append(f"the stated noise does not explain the correction (p = {test.p_value:.2g})")
    prediction = predict_failure(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach)
    if prediction.fails:
        sentences.append(f"predicted: {prediction.sentence}")
    return "; ".join(sentences)


def describe_arm_limits(scenario: Scenario, plan: Plan | None, arm: str) -> str:
    """Whether an arm can execute a plan: the predicted failure, or how far the joints stay from their limits.

    For example: `panda_primitive: operation 3 (shaft) will fail: the arm holds its way to 0.089 mm only, and ..`.

    Args:
        plan: None: the nominal plan in the middle of its region on the table.

    Raises:
        InputError: The arm is unknown, or its gripper cannot hold a part.
    """
    scene = build_scene(scenario, arm=arm)
    if plan is None:
        x, y = scenario.site.center_m
        at = place_layout(scenario, x, y, float(np.mean(scenario.site.yaw_rad)), clearance_mm=scene.clearance_mm)
        plan = Plan(scenario.assembly, at.start, at.poses)
    moves = arm_moves(plan, scene)
    prediction = predict_failure(plan, scene.clearance_mm, scenario.thresholds, scenario.attach, moves)
    margins = [move.margin_deg for move in moves if move.margin_deg is not None]
    room = f"; its joints stay {min(margins):.0f} deg from their limits" if margins and not prediction.fails else ""
    return f"{arm}: {prediction.sentence}{room}"
