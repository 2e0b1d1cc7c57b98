"""What a method makes of an observation: a plan, or why there is none; and what speaks against a plan.

Nominal goals put to where things were seen; best of all they fit in the baseline `nominal`.

`nominal` reads the nominal goals of the scenario, which no corrector may, and no contact. Whatever the relative
goals of a layout are, it builds the same assembly.
"""

import math
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.optimize import least_squares

from apo_bench.assembly import Correction, Observation, Outcome, Plan, Reobserver, largest_gap
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.failure import predict
from apo_bench.records import with_simulated
from apo_bench.scenario import Scenario, layout_at
from apo_bench.simulation.arm_checks.plan_check import arm_moves
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.fitting import FittingPlan, fitting_plan
from apo_bench.trial.stages import observation_failure


def goals_by_heart(nominal: Array, observation: Observation) -> Array:
    """The nominal goals where x, y and yaw fit best what was seen.

    Least squares over all operations that were seen, each twist weighted with its stated covariance S = L L^t:
    min sum |L^-1 log((A N_k)^-1 G_k)|^2 over A = (x, y, yaw), with N_k nominal and G_k seen.

    Args:
        nominal: (n, 4, 4), frame of the assembly, [m].
        observation: At least one operation was seen.

    Returns:
        (n, 4, 4), world frame.
    """
    seen = np.flatnonzero(observation.observed)
    # whitened by L^-1, where S = L L^t, a twist counts in standard deviations
    factors = [np.linalg.inv(np.linalg.cholesky(observation.covariance[k])) for k in seen]

    def residuals(place: Array) -> Array:
        T = _planar(place)
        twists = [pose.log(pose.inverse(T @ nominal[k]) @ observation.poses[k]) for k in seen]
        return np.concatenate([L @ twist for L, twist in zip(factors, twists, strict=True)])

    start = _rough(nominal[seen], observation.poses[seen])
    return np.asarray(_planar(least_squares(residuals, start, x_scale=[0.01, 0.01, 0.1]).x) @ nominal)


def nominal_where_seen(nominal: Array, observation: Observation) -> Array:
    """The nominal goals (n, 4, 4) shifted and turned on the table to where the first operation was seen."""
    k = int(np.argmax(observation.observed))
    # of the whole motion from nominal to seen only the yaw and the shift on the table are taken
    T = observation.poses[k] @ pose.inverse(nominal[k])
    flat = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))))
    flat[:2, 3] = (observation.poses[k] - flat @ nominal[k])[:2, 3]
    return np.asarray(flat @ nominal)


def _rough(nominal: Array, goals: Array) -> Array:
    """(x, y, yaw): the mean turn of the parts, then the mean of what is left."""
    # the mean yaw maximises the sum of tr(Rz(yaw)^t R_k) over the turns R_k from nominal to seen
    turns = goals[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
    sine = (turns[:, 1, 0] - turns[:, 0, 1]).sum()
    yaw = float(np.arctan2(sine, (turns[:, 0, 0] + turns[:, 1, 1]).sum()))
    T = _planar(np.array([0.0, 0.0, yaw]))
    return np.append((goals[:, :2, 3] - (T @ nominal)[:, :2, 3]).mean(axis=0), yaw)


def _planar(place: Array) -> Array:
    """(x, y, yaw) as (4, 4)."""
    x, y, yaw = place
    return pose.at((x, y, 0.0), (0.0, 0.0, float(np.degrees(yaw))))


@final
@dataclass(frozen=True, eq=False)
class MethodResult:
    """What a method made of an observation: a plan, or why there is none."""

    plan: Plan | None
    failure: Outcome | None
    gap_before_m: float
    gap_after_m: float
    """Of the plan; not a number where there is none."""
    correction: Correction | None = None
    """What the corrector returned; None where none was asked."""
    fitting: FittingPlan | None = None
    """What of the plan was chosen so that it fits; None where no corrector made one."""


def apply_method(
    method: Any,
    observation: Observation,
    truth: Array | None,
    reobserve: Reobserver | None = None,
    where: Scene | Scenario | None = None,
) -> MethodResult:
    """What a method would have the robot do.

    Args:
        method: `oracle` takes the truth, `none` what was seen, `nominal` the goals of the scenario of `where`;
            anything else is a corrector or names one.
        observation: As the planner has it: its contacts may be missed, false or recognised, and are those of the plan.
        truth: (n, 4, 4) goals of the layout; only the oracle looks at them.
        reobserve: What a corrector that can ask sees operations again by.
        where: What the plan of a corrector is to be carried out in: what contacts leave free is chosen so that it fits
            there. None: it stays as the corrector left it.
    """
    if isinstance(method, str) and method == "oracle" and truth is not None:
        return _uncorrected(observation, truth, None)
    if isinstance(method, str) and method == "uncorrected":
        return _uncorrected(observation, observation.poses, observation_failure(observation))
    if isinstance(method, str) and method == "nominal" and where is not None:
        return _by_heart(observation, where)
    correction = correct(observation, with_simulated(method), reobserve)
    if not correction.ok:
        failure = Outcome("correct", correction.status, None, correction.sentence)
        return MethodResult(None, failure, correction.gap_before_m, math.nan, correction)
    plan = correction.plan(observation)
    fitting = FittingPlan(plan) if where is None else fitting_plan(correction, observation, where)
    after_m = (
        largest_gap(plan.assembly, plan.start, fitting.plan.target_poses) if fitting.moves else correction.gap_after_m
    )
    return MethodResult(fitting.plan, None, correction.gap_before_m, after_m, correction, fitting)


def _by_heart(observation: Observation, where: Scene | Scenario) -> MethodResult:
    scenario = where.scenario if isinstance(where, Scene) else where
    if not observation.observed.any():
        return _uncorrected(observation, observation.poses, observation_failure(observation))
    return _uncorrected(observation, goals_by_heart(scenario.goals, observation), None)


def _uncorrected(observation: Observation, goals: Array, failure: Outcome | None) -> MethodResult:
    gap_m = largest_gap(observation.assembly, observation.start, goals)
    if failure:
        return MethodResult(None, failure, gap_m, math.nan)
    return MethodResult(Plan(observation.assembly, observation.start, goals), None, gap_m, gap_m)


def plan_warning(scenario: Scenario, plan: Plan, correction: Correction | None) -> str:
    """`the stated noise does not explain the correction (p = 0.0004); foretold: operation 3 (stick) will fail: ..`.

    Empty if nothing speaks against it.

    Args:
        correction: What the corrector returned; None where none was asked.
    """
    sentences = []
    test = None if correction is None else correction.test_after or correction.test
    if test is not None and not test.passes:
        sentences.append(f"the stated noise does not explain the correction (p = {test.p_value:.2g})")
    prediction = predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach)
    if prediction.fails:
        sentences.append(f"foretold: {prediction.sentence}")
    return "; ".join(sentences)


def arm_sentence(scenario: Scenario, plan: Plan | None, arm: str) -> str:
    """`panda_primitive: operation 3 (shaft) will fail: the arm holds its way to 0.089 mm only, and ..`.

    Where nothing fails, how much room its joints have.

    Args:
        plan: None: the nominal one in the middle of its place on the table.

    Raises:
        InputError: The arm is unknown, or its gripper cannot hold a part.
    """
    scene = build_scene(scenario, arm=arm)
    if plan is None:
        x, y = scenario.site.center_m
        at = layout_at(scenario, x, y, float(np.mean(scenario.site.yaw_rad)), clearance_mm=scene.clearance_mm)
        plan = Plan(scenario.assembly, at.start, at.poses)
    moves = arm_moves(plan, scene)
    prediction = predict(plan, scene.clearance_mm, scenario.thresholds, scenario.attach, moves)
    margins = [move.margin_deg for move in moves if move.margin_deg is not None]
    room = f"; its joints stay {min(margins):.0f} deg from their limits" if margins and not prediction.fails else ""
    return f"{arm}: {prediction.sentence}{room}"
