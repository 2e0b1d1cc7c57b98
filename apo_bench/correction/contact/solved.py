"""Nearest poses for a choice of contacts, with gaps, rank, covariance and test."""

from collections.abc import Sequence
from math import cos, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Consistency, find_largest_residual
from apo_bench.correction.checks.chi_square import CONTRADICTION_M, p_value
from apo_bench.correction.contact.problem import Problem
from apo_bench.correction.contact.squared_length import chi_square_test, chi_squares, relaxed_chi_square
from apo_bench.correction.solvers import (
    NearestPoses,
    compute_jacobian_rank,
    compute_marginals,
    compute_projections,
    count_active_directions,
    find_nearest_between,
)
from apo_bench.geometry import Array

FAR_DEG = 45.0
"""Rotation of a pose by the correction beyond which a local minimum is likely. Of 320 corrections at 8 mm and degrees,
over the eight scenarios, none turned a pose by more than 33 degrees. Every one that was longer than the truth, at 25
and 40, did by 56 or more."""
_FAR = 1.0 + 2.0 * cos(radians(FAR_DEG))
"""The trace of a rotation matrix by that angle."""


class Solved(NamedTuple):
    """The solution of one observation for some contacts."""

    poses: Array
    """(n, 4, 4), world, [m]."""
    z: Array
    """(6 n,): the correction in standard deviations."""
    at_rest: bool
    """Whether the solver converged."""
    finite: bool
    """Whether all numbers stayed finite."""
    trace: Sequence[tuple[float, float]]
    """As of `NearestPoses`."""
    test: Consistency
    gaps: Array
    """(c,): the largest |e| of each contact at the poses, [m]; for an inequality its violation."""
    worst_m: float
    """The largest gap of all contacts, [m]."""
    kept_m: float
    """The largest gap of the contacts that were solved for, [m]."""
    away: bool
    """Whether the faces of a contact do not oppose at the poses."""
    rank: int
    """Directions that the equations fix at the poses."""
    covariance: Array | None
    """(n, 6, 6), of the body twists at the poses, [m, rad]; None for very many operations."""
    far: bool
    """Whether a pose is turned by more than `FAR_DEG`."""


def solve(problem: Problem, kept: NDArray[np.bool_]) -> list[Solved]:
    """The nearest poses of each observation for the contacts that are `kept`, (c,), with the test of the correction.

    Contradictory contacts have no consistent poses; then the poses share the contradiction out by least squares.
    """
    chosen = kept & problem.demands.exact
    nearest = problem.nearest(chosen)
    chi_square, simple = chi_squares(problem, chosen, nearest)
    if problem.observation.tails is not None or not (problem.demands.all_exact or problem.demands.exact[kept].all()):
        simple[:] = False
    solutions = _describe(problem, kept, nearest, chi_square.tolist())
    return [
        solved
        if easy and solved.kept_m <= observation.gap_m
        else _describe_in_full(problem.only(i), kept, nearest.at(i).batch())
        for i, (observation, easy, solved) in enumerate(
            zip(problem.observations, simple.tolist(), solutions, strict=True)
        )
    ]


def run_tests(problem: Problem, choices: NDArray[np.bool_]) -> list[Consistency]:
    """The test of one observation for each choice of contacts, (k, c)."""
    tests: list[Consistency | None] = [None] * len(choices)
    if problem.is_plain and len(choices):
        nearest = problem.nearest_by_each(choices)
        chi_square, simple = chi_squares(problem, problem.all_contacts, nearest)
        for i in np.flatnonzero(simple):
            rank = compute_jacobian_rank(nearest.Jt[i])
            tests[i] = Consistency(float(chi_square[i]), rank, p_value(chi_square[i], rank), problem.level)
    return [test or _run_test(problem, kept) for test, kept in zip(tests, choices, strict=True)]


def _run_test(problem: Problem, kept: NDArray[np.bool_]) -> Consistency:
    """The test of one observation for one choice of contacts, (c,)."""
    if not problem.demands.exact[kept].all():
        return solve(problem, kept)[0].test
    nearest = problem.nearest(kept)
    return chi_square_test(problem, kept, nearest, *relaxed_chi_square(problem, kept, nearest))


def pull(problem: Problem, kept: NDArray[np.bool_]) -> Array:
    """The squared multipliers of the equations of each contact of one observation, (c,): how much it forces the
    poses.
    """
    chosen = kept & problem.demands.exact
    soft = np.hypot(problem.slack(chosen), CONTRADICTION_M)
    multipliers = np.zeros((len(chosen), 3))
    multipliers[chosen] = (problem.nearest(chosen, soft).e[0] / soft).reshape(-1, 3)
    return np.asarray(np.square(multipliers).sum(axis=1))


def turned_far(observed: Array, poses: Array) -> NDArray[np.bool_]:
    """Whether a correction turns any pose by more than `FAR_DEG`: observed and corrected (b, n, 4, 4) -> (b,)."""
    # The trace of R_seen^t R is 1 + 2 cos of the angle between them.
    traces = np.einsum("bnij,bnij->bn", observed[:, :, :3, :3], poses[:, :, :3, :3])
    return np.asarray(traces.min(axis=1, initial=3.0) < _FAR)


def _describe(
    problem: Problem, kept: NDArray[np.bool_], nearest: NearestPoses, chi_square: list[float]
) -> list[Solved]:
    """The `Solved` of each observation of a batch, given nearest poses and squared lengths of corrections, (b,)."""
    all_kept = bool(kept.all())
    poses = nearest.poses
    forms = nearest.forms if all_kept and problem.demands.all_exact else problem.laid.system.forms(poses)
    gaps = problem.gaps(poses, forms)
    worst_m = gaps.max(axis=1, initial=0.0).tolist()
    kept_m = worst_m if all_kept else gaps[:, kept].max(axis=1, initial=0.0).tolist()
    away = np.any(problem.laid.faces_away(forms), axis=1).tolist()
    far = turned_far(problem.poses, poses).tolist()
    at_rest = nearest.at_rest.tolist()
    finite = nearest.finite.tolist()
    rank, free_projection = compute_projections(nearest.Jt)
    covariance = [None] * len(rank) if free_projection is None else compute_marginals(nearest.B, free_projection)
    tests = [Consistency(x, r, p_value(x, r), problem.level) for x, r in zip(chi_square, rank, strict=True)]
    before = poses, nearest.z, at_rest, finite, nearest.trace, tests
    return [
        Solved._make(fields) for fields in zip(*before, gaps, worst_m, kept_m, away, rank, covariance, far, strict=True)
    ]


def _describe_in_full(problem: Problem, kept: NDArray[np.bool_], nearest: NearestPoses) -> Solved:
    """The `Solved` of one observation with contradictory contacts, inequalities or tails.

    Active inequalities count like equations. Given which ones are active, the squared length is chi-square distributed
    with so many more degrees of freedom, if they are active at the truth too, and shorter otherwise (Shapiro, "Towards
    a unified theory of inequality constrained testing", 1988).
    """
    exact = problem.demands.exact
    chosen = kept & exact
    chi_square, degrees = relaxed_chi_square(problem, chosen, nearest)
    if nearest.finite[0] and find_largest_residual(problem.gaps(nearest.poses)[:, chosen]) > problem.observation.gap_m:
        nearest = problem.nearest(chosen, np.hypot(problem.slack(chosen), CONTRADICTION_M))
    elif nearest.finite[0] and not exact[kept].all():
        inequalities = problem.inequalities[0].among(kept[~exact])
        start = nearest.at(0)
        held = find_nearest_between(problem.among(chosen).only(0), inequalities, problem.poses[0], problem.L[0], start)
        chi_square += float(held.z @ held.z - start.z @ start.z)
        degrees += count_active_directions(start.Jt, inequalities, held)
        nearest = held.batch()
    (solved,) = _describe(problem, kept, nearest, [chi_square])
    return solved._replace(test=chi_square_test(problem, chosen, nearest, chi_square, degrees))
