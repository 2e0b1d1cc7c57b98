"""Chi-square of a correction: its squared length in standard deviations, and the test of that.

Where contacts contradict each other or parts fit with play, equations need not hold exactly. Their residuals, in
standard deviations of their own, are added to the squared length.
"""

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Consistency, find_largest_residual
from apo_bench.correction.checks.chi_square import CONTRADICTION_M, p_value, soft_chi_square
from apo_bench.correction.contact.drawn import drawn_chi_squares, drawn_p_value
from apo_bench.correction.contact.problem import Problem
from apo_bench.correction.solvers import (
    NearestPoses,
    compute_jacobian_rank,
)
from apo_bench.geometry import Array


def chi_squares(problem: Problem, chosen: NDArray[np.bool_], nearest: NearestPoses) -> tuple[Array, NDArray[np.bool_]]:
    """Squared lengths of corrections, (b,), and whether each may be tested as it is, (b,).

    It may if the contacts hold and play needs no further solution; otherwise use `relaxed_chi_square`.
    """
    holds = nearest.finite & nearest.at_rest & (np.abs(nearest.e).max(axis=1, initial=0.0) <= CONTRADICTION_M)
    S = problem.play_covariance(chosen)
    if S is not None:
        Jt = nearest.Jt if isinstance(nearest.Jt, np.ndarray) else nearest.Jt[0].toarray()[None]
        return soft_chi_square(nearest.z, Jt, S), holds
    if problem.demands.slack_m is not None and problem.slack(chosen).any():
        holds[:] = False
    return np.square(nearest.z).sum(axis=1), holds


def relaxed_chi_square(problem: Problem, chosen: NDArray[np.bool_], nearest: NearestPoses) -> tuple[float, int]:
    """The squared length of one correction and its degrees of freedom, the rank.

    If contacts contradict each other or fit with play, the solver runs again with a standard deviation for each
    equation. The squared residuals of the equations, in that unit, are then added.
    """
    degrees = compute_jacobian_rank(nearest.Jt[0])
    if not nearest.finite[0]:
        return np.inf, degrees
    (chi_square,), (simple,) = chi_squares(problem, chosen, nearest)
    if simple:
        return float(chi_square), degrees
    slack_m = problem.slack(chosen)
    soft = (
        slack_m
        if nearest.at_rest[0] and find_largest_residual(nearest.e) <= CONTRADICTION_M
        else np.hypot(slack_m, CONTRADICTION_M)
    )
    relaxed = problem.nearest(chosen, soft)
    softened = soft > 0.0
    over = relaxed.e[0, softened] / soft[softened]
    return float(relaxed.z[0] @ relaxed.z[0] + over @ over), degrees


def chi_square_test(
    problem: Problem, chosen: NDArray[np.bool_], nearest: NearestPoses, chi_square: float, degrees: int
) -> Consistency:
    """The test of a squared length with its degrees of freedom, by the chi-square distribution.

    If errors have tails it is a Monte Carlo test, for dense matrices only.
    """
    p = p_value(chi_square, degrees)
    tails = problem.observation.tails
    if tails is not None and degrees and np.isfinite(chi_square) and isinstance(nearest.Jt, np.ndarray):
        drawn = drawn_chi_squares(problem.observation, problem.L[0], nearest.Jt[0], problem.play_covariance(chosen))
        p = drawn_p_value(drawn, chi_square)
    return Consistency(chi_square, degrees, p, problem.level)
