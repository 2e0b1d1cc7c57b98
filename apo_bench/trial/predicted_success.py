"""Predict the success probability of a plan before the robot moves, from what the planner knows.

Every explanation that a corrector kept states possible true poses. Truths are drawn from the explanations, in
proportion to their weights, along directions that contacts leave free. Robots are drawn from the stated robot errors.
Each draw measures how far the plan is from failing: whether the placed parts fit (the measures of `prediction`), and
whether faces overlap as the judge requires if that draw is the truth. Contacts may be wrong too (`contact_errors`), as
often as their source states.

The simulator only provides the scene, the reach of its arm, and the poses to which a robot with errors brings parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtri

from apo_bench.assembly import Assembly, Correction, Observation, Outcome, Plan, Poses
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.arm_move import ArmMove
from apo_bench.records import GIVEN, NO_ROBOT_ERROR, describe_outcome, parse_robot_error
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.contact_errors import (
    ContactError,
    ContactEvidence,
    ContactRates,
    gross_errors,
    missing_contacts,
    rates_of,
)
from apo_bench.trial.free_directions import FreeSpace, find_free_space
from apo_bench.trial.plan_shares import PlanShares, exchange_contacts

if TYPE_CHECKING:
    from apo_bench.simulation.scene.scene import Scene

TRUTHS = 16
"""Draws of the truth, over all explanations."""
ROBOTS = 16
"""Draws of the robot's errors, if any are stated."""
_STREAM = 2_030
"""Seed of the draws, the same for every plan; no trial uses it."""
SLACK_MM = 0.05
"""Standard deviation of effects that the measures neglect: sag, rest, compliance."""
NEGLECTED = 0.5
"""Share of the stated errors of a robot that its draws neglect: slips and friction while it places a part."""
_LEVERS_MM = (100.0, 800.0, 50.0)
"""Lever arms at which angles of robot errors count: of the base, of the joints, of a part in the hand."""
_LEAST = 0.01
"""Predictions are at least this far from 0 and 1."""
_OUTLIER = 0.03
"""Prior probability of an operation that was observed as wrongly as an explanation assumes."""
_RARELY = 0.005
"""Missing contacts with a smaller prior probability are ignored, unless a part would fall without."""
_IMPOSSIBLE = 7.0
"""Errors with a log weight so much smaller than the largest are ignored."""
_SAME = 1e-6
"""Relative difference of covariances, or difference of poses, up to which they are the same."""
_FARTHEST_M = 0.02
"""Largest standard deviation of a draw along a free direction, as translation."""
_FARTHEST_RAD = 0.5
"""The same as rotation."""
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
    contact_source: str = GIVEN,
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
        contact_source: Where the contacts come from, as in records; it states how often they are wrong.
    """
    ends, arm = ((), ()) if isinstance(where, Scenario) else _by_arm(plan, where, robot_error, spiral, probing)
    if any(move.refused is not None for move in arm):
        return _LEAST
    slack_mm = math.hypot(SLACK_MM, NEGLECTED * _stated_mm(robot_error, probing)) if ends else SLACK_MM
    shares = PlanShares(plan, where, arm, ends, slack_mm)
    explained = explanations(correction, believed, plan.target_poses)
    rng = np.random.default_rng(_STREAM)
    spaces = [_free_space(each) for each in explained]
    right = list[float]()
    for each, space in zip(explained, spaces, strict=True):
        kept = _without(plan.assembly, each.dropped)
        truths = draw_truths(each, space, max(1, round(TRUTHS * each.weight)), rng)
        right.append(each.weight * shares.fit(kept) * shares.cover(kept, truths))
    if correction is None or correction.test is None or not believed.observed.all():
        return _bounded(sum(right))
    if correction.hypotheses and contact_source == GIVEN:
        # The corrector has weighed wrong contacts itself, at the rate that it assumes.
        return _bounded(sum(right))
    rates = rates_of(contact_source)
    found = list(zip(explained, spaces, right, strict=True))
    return _bounded(_with_contact_errors(shares, believed, correction, found, rates))


def _bounded(share: float) -> float:
    """The share, but nothing is certain."""
    return min(max(share, _LEAST), 1.0 - _LEAST)


def abstain(predicted_success: float, least: float) -> Outcome:
    """The ending of a trial whose predicted success is below the required least."""
    # as many digits as distinguish the two: 0.947, if 0.95 is required
    shown = next(text for digits in range(2, 20) if float(text := f"{predicted_success:.{digits}f}") < least)
    why = f": {shown}, where {least:.15g} is required"
    return Outcome("predicted-success", "abstained", None, describe_outcome("abstained") + why)


def _with_contact_errors(
    shares: PlanShares,
    believed: Observation,
    correction: Correction,
    explained: Sequence[tuple[PossibleTruth, FreeSpace | None, float]],
    rates: ContactRates,
) -> float:
    """The score of a plan whose contacts may be wrong: the mean over no error and each error, by their posterior.

    Explanations that drop contacts are replaced by the errors of these contacts.

    Args:
        explained: Each explanation, what its contacts leave free, and its weight times the share of it in which the
            plan is right.
    """
    assembly = shares.plan.assembly
    poses = shares.plan.target_poses
    judged = shares.judged
    named = min(1.0, sum(each.weight for each, _, _ in explained))
    trusted = [one for one in explained if not one[0].dropped]
    best, space, _ = (trusted or explained)[0]
    if space is not None and (rates.missing > _RARELY or shares.falls(assembly)):
        odds = rates.missing / (1.0 - rates.missing)
        shares.missing = [
            each._replace(log_weight=each.log_weight + math.log(odds))
            for each in missing_contacts(best.believed, space, judged)
        ]
    evidence = ContactEvidence(believed)
    branches = list[tuple[float, float]]()  # log of prior times likelihood, share in which the plan is right
    if trusted:
        base = evidence.log_density()
        if best.believed is not believed:
            outliers = _count_outliers(believed, best.believed)
            base = ContactEvidence(best.believed).log_density() + outliers * math.log(_OUTLIER)
        whole = sum(each.weight for each, _, _ in trusted)
        base += math.log(whole / best.weight) + math.log(1.0 - rates.false - rates.shifted)
        covered = sum(right for _, _, right in trusted) / whole / max(shares.fit(assembly), _LEAST)
        branches.append((base, named * min(1.0, covered) * shares.fit_or_missing(assembly)))
        if not correction.hypotheses and correction.test is not None and not correction.test.passes:
            for log_weight, truth in gross_errors(believed):
                right = shares.fit_or_missing(assembly) * shares.cover(assembly, truth[None])
                branches.append((log_weight, right))
    errors = list(evidence.errors(poses, judged, rates))
    likely = max([one[0] for one in branches] + [each.log_weight for each in errors]) - _IMPOSSIBLE
    for each in (each for each in errors if each.log_weight > likely):
        rest = _remove(assembly, each)
        log_weight = each.log_weight
        if not each.exists and shares.falls(rest):
            # The part stood in the demonstration, so a contact that carries it must be missing too.
            log_weight += math.log(rates.missing)
        right = shares.fit_or_missing(rest, assembly if each.exists else rest) * each.accepted
        branches.append((log_weight, named * right * shares.cover(rest, evidence.truth(each)[None])))
    mass, share_of = np.array(branches).T
    weights = np.exp(mass - mass.max())
    return float(weights @ share_of / weights.sum())


def _stated_mm(robot_error: str, probing: bool) -> float:
    """About how far stated errors of a robot displace a part, [mm]; if it probes, only the slips in its hand count."""
    sigmas = parse_robot_error(robot_error)
    base, joints, hand = _LEVERS_MM
    slip = sigmas.in_hand[0] + hand * math.radians(sigmas.in_hand[1])
    if probing:
        return slip
    return (
        slip
        + sigmas.tool_mm
        + sigmas.hand_eye[0]
        + math.radians(base * sigmas.hand_eye[1] + joints * sigmas.joints_deg)
    )


def _count_outliers(believed: Observation, assumed: Observation) -> int:
    """Number of operations of which another pose or covariance is assumed than observed, but for a common scale."""
    moved = np.abs(assumed.poses - believed.poses).max(axis=(1, 2)) > _SAME
    ratio = np.trace(assumed.covariance, axis1=1, axis2=2) / np.trace(believed.covariance, axis1=1, axis2=2)
    return int((moved | (ratio > ratio.min() * (1.0 + _SAME))).sum())


def _remove(assembly: Assembly, error: ContactError) -> Assembly:
    """The assembly without the contact of an error."""
    return exchange_contacts(assembly, error.made, lambda contacts: tuple(c for c in contacts if c != error.contact))


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


def _free_space(explanation: PossibleTruth) -> FreeSpace | None:
    """What the contacts of an explanation leave free; None if that is nothing or unknown."""
    try:
        return find_free_space(explanation.believed, explanation.poses)
    except InputError:
        return None


def draw_truths(explanation: PossibleTruth, space: FreeSpace | None, count: int, rng: np.random.Generator) -> Array:
    """Draw possible true poses of an explanation, (count, n, 4, 4), along directions that contacts leave free.

    Args:
        space: Of the explanation.
    """
    goals = explanation.poses
    truths = np.repeat(goals[None], count, axis=0)
    if space is not None:
        widths = _widths(space)
        truths = np.array([space.move_along_tangent(widths * s) for s in _spread(rng, count, (len(space),))])
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
    if not dropped:
        return assembly
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
