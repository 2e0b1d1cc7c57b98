"""Apply a method to an observation: a plan, or why there is none."""

import math
from dataclasses import dataclass
from typing import Any, final

from apo_bench.assembly import Correction, Observation, Outcome, Plan, Reobserver, measure_largest_gap
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array
from apo_bench.records import resolve_simulated
from apo_bench.scenario import Scenario
from apo_bench.simulation.scene import Scene
from apo_bench.trial.nominal_poses import fit_nominal_poses
from apo_bench.trial.plan_fitting import FittingPlan, fit_plan
from apo_bench.trial.trial_stages import observation_failure


@final
@dataclass(frozen=True, eq=False)
class MethodResult:
    """The plan that a method made of an observation, or why there is none."""

    plan: Plan | None
    failure: Outcome | None
    gap_before_m: float
    """Largest contact gap of the observed poses, or of those that the method uses uncorrected."""
    gap_after_m: float
    """Largest contact gap of the plan; not a number without one."""
    correction: Correction | None = None
    """The result of the corrector; None without a corrector."""
    fitting: FittingPlan | None = None
    """The moves of the plan along free directions; None unless a corrector made the plan."""


def apply_method(
    method: Any,
    observation: Observation,
    truth: Array | None,
    reobserve: Reobserver | None = None,
    where: Scene | Scenario | None = None,
) -> MethodResult:
    """Make the plan of a method.

    Args:
        method: `oracle` plans with the truth, `uncorrected` with the observed poses, `nominal` with the poses of the
            scenario of `where`; anything else is a corrector or names one.
        observation: As the planner has it: its contacts may be missing, false or detected, and are those of the plan.
        truth: (n, 4, 4) poses of the layout, world frame, [m]; only the oracle reads them.
        reobserve: Lets a corrector observe operations again; None: it cannot.
        where: Scene or scenario of the execution, in which the plan of a corrector must fit (`fit_plan`). None: the
            plan stays as the corrector made it.
    """
    if isinstance(method, str):
        if method == "oracle" and truth is not None:
            return _plan_uncorrected(observation, truth, None)
        if method == "nominal" and where is not None and observation.observed.any():
            scenario = where.scenario if isinstance(where, Scene) else where
            return _plan_uncorrected(observation, fit_nominal_poses(scenario.nominal_poses, observation), None)
        if method == "uncorrected" or (method == "nominal" and where is not None):
            return _plan_uncorrected(observation, observation.poses, observation_failure(observation))
    correction = correct(observation, resolve_simulated(method), reobserve)
    if not correction.ok:
        failure = Outcome("correct", correction.status, None, correction.sentence)
        return MethodResult(None, failure, correction.gap_before_m, math.nan, correction)
    plan = correction.plan(observation)
    fitting = FittingPlan(plan) if where is None else fit_plan(correction, observation, where)
    after_m = correction.gap_after_m
    if fitting.moves:
        after_m = measure_largest_gap(plan.assembly, plan.start, fitting.plan.target_poses)
    return MethodResult(fitting.plan, None, correction.gap_before_m, after_m, correction, fitting)


def _plan_uncorrected(observation: Observation, poses: Array, failure: Outcome | None) -> MethodResult:
    """The result of a method that plans with given poses, (n, 4, 4), or fails."""
    gap_m = measure_largest_gap(observation.assembly, observation.start, poses)
    if failure:
        return MethodResult(None, failure, gap_m, math.nan)
    return MethodResult(Plan(observation.assembly, observation.start, poses), None, gap_m, gap_m)
