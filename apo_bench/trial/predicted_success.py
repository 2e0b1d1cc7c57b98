"""Predict the success probability of a plan before the robot moves, from what the planner knows.

Every explanation that a corrector kept states possible true poses. Truths are drawn from the explanations, in
proportion to their weights, along directions that contacts leave free. Robots are drawn from the stated robot errors.
Each draw measures how far the plan is from failing: whether the placed parts fit (the measures of `prediction`), and
whether faces overlap as the judge requires if that draw is the truth. The mean over the draws is the *score*. A table
of other assemblies gives the share of plans with such a score that succeeded.

The simulator only provides the scene, the reach of its arm, and the poses to which a robot with errors brings parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from apo_bench.assembly import Assembly, Correction, Observation, Outcome, Plan, Poses, compute_placements
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.judging.finished_assembly import compute_least_overlaps
from apo_bench.planning.prediction.plan_measures import (
    ArmMove,
    DrawnMeasure,
    Measure,
    measure_drawn_plans,
    measure_plan,
)
from apo_bench.records import NO_ROBOT_ERROR, describe_outcome, parse_robot_error
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.free_directions import FreeSpace, free_space
from apo_bench.trial.predicted_success_table import RATES, SCORES

if TYPE_CHECKING:
    from apo_bench.simulation.scene.scene import Scene

TRUTHS = 16
"""Draws of the truth, over all explanations."""
ROBOTS = 16
"""Draws of the robot's errors, if any are stated."""
_STREAM = 2_030
"""Seed of the draws, the same for every plan; no trial uses it."""
_SLACK_MM = 0.05
"""Standard deviation of effects that the measures neglect: sag, rest, compliance."""
_SLACK_SHARE = 0.1
"""The same for an overlap, as a share of the face."""
_FARTHEST_M = 0.02
"""Largest standard deviation of a draw along a free direction, as translation."""
_FARTHEST_RAD = 0.5
"""The same as rotation."""
_FALLS = 0.02
"""Factor of the score for each part that would fall or lean."""
_LEVEL = 0.5
"""An insertion axis is level if its cosine with the vertical is smaller: weight does not help the insertion there."""
_WEIGHED = ("falls", "leans")
"""Kinds of measures of stability, which no draw changes."""
_UNKNOWN = 0.5
"""Share of overlaps if the faces meet in no drawn truth."""
_LEAST_WEIGHT = 0.01
"""Explanations with a smaller weight are ignored."""


class PossibleTruth(NamedTuple):
    """One explanation of the observation: possible true poses and their probability; the weights sum to at most 1."""

    weight: float
    believed: Observation
    """The observation as this explanation assumes it."""
    poses: Array
    """(n, 4, 4), world frame, [m]."""
    dropped: tuple[str, ...] = ()
    """Contacts that are false in this explanation."""
    turned: bool = False
    """Whether the yaw of the assembly on the table is unknown, since nothing was observed."""


def explanations(correction: Correction | None, believed: Observation, goals: Array) -> tuple[PossibleTruth, ...]:
    """The explanations that a corrector kept, likely ones only; without any, its estimate alone.

    Args:
        believed: The observation that the corrector was given.
        goals: (n, 4, 4), target poses of the plan.
    """
    blind = not believed.observed.any()
    if correction is None:
        return (PossibleTruth(1.0, believed, goals),)
    if not correction.hypotheses:
        return (PossibleTruth(1.0, correction.assumed or believed, correction.poses, correction.dropped, blind),)
    likely = [each for each in correction.hypotheses if each.weight >= _LEAST_WEIGHT]
    # Factor that gives the weight of ignored explanations to the likely ones.
    share = sum(each.weight for each in correction.hypotheses) / sum(each.weight for each in likely)
    return tuple(PossibleTruth(share * each.weight, each.assumed, each.poses, each.dropped, blind) for each in likely)


def predict_success(
    plan: Plan,
    believed: Observation,
    correction: Correction | None,
    where: Scene | Scenario,
    robot_error: str = NO_ROBOT_ERROR,
    spiral: bool = False,
    probing: bool = False,
) -> float:
    """The probability that a plan succeeds; the result is deterministic.

    Args:
        plan: With the contacts that the planner was given.
        believed: The observation that the planner was given, with its contacts.
        correction: The correction of it; None without a corrector.
        where: Scene of the execution. For a scenario, every pose counts as in reach.
        robot_error: The stated errors of the robot, as in records; ignored for a scenario.
        spiral: The robot searches for a hole in a spiral if an insertion is stopped.
        probing: The robot probes first and compensates its errors; only the slip of parts in its hand remains.
    """
    explained = explanations(correction, believed, plan.target_poses)
    score = plan_score(plan, explained, where, robot_error, spiral, probing)
    return float(np.interp(score, SCORES, RATES))


def abstain(predicted_success: float, least: float) -> Outcome:
    """The ending of a trial whose predicted success is below the required least."""
    # as many digits as distinguish the two: 0.947, if 0.95 is required
    shown = next(text for digits in range(2, 20) if float(text := f"{predicted_success:.{digits}f}") < least)
    why = f": {shown}, where {least:.15g} is required"
    return Outcome("predicted-success", "abstained", None, describe_outcome("abstained") + why)


def plan_score(
    plan: Plan,
    explained: Sequence[PossibleTruth],
    where: Scene | Scenario,
    robot_error: str = NO_ROBOT_ERROR,
    spiral: bool = False,
    probing: bool = False,
) -> float:
    """The score of a plan, from 0 to 1, which the table turns into a probability.

    Args:
        plan: With the contacts that the planner was given.
        where, robot_error, spiral, probing: As in `predict_success`.
    """
    ends, arm = ((), ()) if isinstance(where, Scenario) else _by_arm(plan, where, robot_error, spiral, probing)
    if any(move.refused is not None for move in arm):
        return 0.0
    rng = np.random.default_rng(_STREAM)
    fits = dict[tuple[str, ...], float]()
    score = 0.0
    for each in explained:
        kept = replace(plan, assembly=_without(plan.assembly, each.dropped)) if each.dropped else plan
        if each.dropped not in fits:
            fits[each.dropped] = _fit_share(kept, where, arm, ends)
        truths = draw_truths(each, max(1, round(TRUTHS * each.weight)), rng)
        score += each.weight * fits[each.dropped] * _cover_share(kept, truths, where)
    return score


def _by_arm(
    plan: Plan, scene: Scene, robot_error: str, spiral: bool, probing: bool
) -> tuple[tuple[Poses, ...], tuple[ArmMove, ...]]:
    """Poses of parts placed by robots with drawn errors, as `measure_drawn_plans` takes them, and the motions of the
    arm.

    The poses are empty if the robot has no errors, or if a pose is out of reach.
    """
    from apo_bench.simulation.arm_checks.plan_check import arm_moves
    from apo_bench.trial.robot_draws import brought, left_after_feeling, stack_errors
    from apo_bench.trial.trial_stages import robot_error_of

    arm = arm_moves(plan, scene, spiral)
    slip = parse_robot_error(robot_error).in_hand
    right = not any(slip) if probing else robot_error == NO_ROBOT_ERROR  # whether the robot has no errors that count
    if right or any(move.refused is not None for move in arm):
        return (), arm
    errors = [robot_error_of(robot_error, scene, partial(_robot_draw, draw)) for draw in range(ROBOTS)]
    if probing:
        errors = [left_after_feeling(plan, scene, error, slip[1]) for error in errors]
    return brought(plan, scene, stack_errors(errors), spiral), arm


def _robot_draw(draw: int, which: int, shape: tuple[int, ...]) -> Array:
    """Standard normal numbers, (*shape), of robot number `draw`, from stream `which` of the robot's errors."""
    return np.asarray(_robot_draws(which, shape)[draw])


@lru_cache(maxsize=16)
def _robot_draws(which: int, shape: tuple[int, ...]) -> Array:
    """Standard normal numbers of all robots, (`ROBOTS`, *shape), the same in every call."""
    return _spread(np.random.default_rng([_STREAM, which]), ROBOTS, shape)


def draw_truths(explanation: PossibleTruth, count: int, rng: np.random.Generator) -> Array:
    """Draw possible true poses of an explanation, (count, n, 4, 4), along directions that contacts leave free."""
    goals = explanation.poses
    try:
        space = free_space(explanation.believed, goals)
    except InputError:
        space = None
    truths = np.repeat(goals[None], count, axis=0)
    if space is not None:
        widths = _widths(space)
        truths = np.array([space.tangent(widths * s) for s in _spread(rng, count, (len(space),))])
    if explanation.turned:
        middle = pose.at(goals[:, :3, 3].mean(axis=0))
        # Yaws are spread evenly over the full turn, in random order, about the mean position.
        turns = [pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) for yaw in 360.0 * (rng.permutation(count) + 0.5) / count]
        truths = np.array([middle @ turn @ pose.inverse(middle) @ T for turn, T in zip(turns, truths, strict=True)])
    return truths


def _widths(space: FreeSpace) -> Array:
    """Standard deviation of draws along free directions, (f,), relative to the stated one, bounded by `_FARTHEST_*`."""
    # largest translation of an operation, (f,)
    far = np.linalg.norm(space.twists[:, :3], axis=1).max(axis=0) / _FARTHEST_M
    turned = np.linalg.norm(space.twists[:, 3:], axis=1).max(axis=0) / _FARTHEST_RAD  # largest rotation
    return np.asarray(1.0 / np.maximum(1.0, np.maximum(far, turned)))


def _spread(rng: np.random.Generator, count: int, shape: tuple[int, ...]) -> Array:
    """Latin hypercube sample of standard normal numbers, (count, *shape) (McKay, 1979).

    Each number falls into its own interval of equal probability among the `count` samples.
    """
    parts = rng.permuted(np.tile(np.arange(count), (math.prod(shape), 1)), axis=1).T
    return np.asarray(ndtri((parts + rng.uniform(size=parts.shape)) / count).reshape(count, *shape))


def _without(assembly: Assembly, dropped: tuple[str, ...]) -> Assembly:
    """The assembly without the named contacts."""
    left = {
        (relation.made, relation.contact)
        for relation, kept in zip(assembly.relations(), assembly.without(dropped), strict=True)
        if kept
    }
    operations = [
        replace(operation, contacts=tuple(c for c in operation.contacts if (k, c) in left))
        for k, operation in enumerate(assembly.operations)
    ]
    return replace(assembly, operations=tuple(operations))


def _fit_share(plan: Plan, where: Scene | Scenario, arm: Sequence[ArmMove], ends: Sequence[Poses]) -> float:
    """Probability that all measures of a plan are within their limits, as a product over measures, mean over robots.

    Args:
        ends: From `_by_arm`; empty: as planned.
    """
    scenario = where if isinstance(where, Scenario) else where.scenario
    # |cosine| of each insertion axis with the vertical
    ways = [abs(float(T[2, :3] @ how.direction)) for how, T in zip(scenario.attach, plan.target_poses, strict=True)]
    # per operation, for `_within`
    less_mm = [scenario.thresholds.fit_margin_mm if rise < _LEVEL else 0.0 for rise in ways]
    lengths = where.clearance_mm, scenario.thresholds
    planned = measure_plan(plan, *lengths, scenario.attach, arm=arm)
    # With drawn robots only stability comes from the plan itself; the other measures are drawn.
    stands = np.prod([_within(each, less_mm) for each in planned if each.kind in _WEIGHED or not ends])
    if not ends:
        return float(stands)
    drawn = measure_drawn_plans(plan, *lengths, scenario.attach, arm, ends)
    return float(stands * np.array([_within(each, less_mm) for each in drawn]).prod(axis=0).mean())


def _within(measure: Measure | DrawnMeasure, less_mm: Sequence[float]) -> Array:
    """Probability that one measure is within its limit, (), or (r,) for r draws.

    Args:
        less_mm: Per operation, reduction of the judge's limit for insertion contacts, [mm].
    """
    if isinstance(measure, Measure) and measure.kind in _WEIGHED:
        return np.asarray(_FALLS if measure.exceeded else 1.0)
    allowed = measure.allowed - (less_mm[measure.operation] if measure.kind in ("fit", "tip") else 0.0)
    return np.asarray(ndtr((allowed - measure.size) / _SLACK_MM))


def _cover_share(plan: Plan, truths: Array, where: Scene | Scenario) -> float:
    """Probability that faces overlap as the judge requires, if the plan is executed exactly; mean over the truths.

    Args:
        truths: From `draw_truths`, (count, n, 4, 4).
    """
    scenario = where if isinstance(where, Scenario) else where.scenario
    overlaps = compute_least_overlaps(
        plan.assembly, compute_placements(plan.assembly, plan.start, plan.target_poses)[-1], truths
    )
    possible = overlaps[np.isfinite(overlaps)]  # without truths in which faces do not meet
    if not len(possible):
        return _UNKNOWN
    return float(np.mean(ndtr((possible - scenario.thresholds.overlap_fraction) / _SLACK_SHARE)))
