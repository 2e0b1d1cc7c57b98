"""Monte Carlo test and regions of a correction whose errors have tails, from draws of the stated noise.

Near the solution everything is linear. The correction has the length of the error in the directions that contacts fix,
and the corrected poses have the rest of the error. Both are drawn with the noise, and observed values are compared with
drawn ones (Monte Carlo p-value; Davison and Hinkley, "Bootstrap Methods and their Application", 1997, Section 4.2).
"""

import numpy as np

from apo_bench.assembly import Observation, compute_joint_covariance
from apo_bench.correction.checks.chi_square import ROUNDING
from apo_bench.correction.solvers import (
    whiten_twists,
)
from apo_bench.geometry import Array

DRAWS = 2000
"""Number of drawn errors."""


def drawn_chi_squares(
    observation: Observation, L: Array, Jt: Array, S: Array | None, left_out: tuple[int, ...] = ()
) -> Array:
    """Squared lengths of the corrections of drawn errors, (DRAWS,), ascending.

    Args:
        L: As of `factor_noise`.
        Jt: (6 n, 3 c), the transposed derivative of the equations by z, at a solution.
        S: (3 c, 3 c), the covariance of the equations from play, [m^2]; None: none.
        left_out: Operations whose poses are inferred and agree with their contacts: their errors are 0.
    """
    r = _draw(observation, L, left_out) @ Jt
    # As `soft_chi_square`, of errors that are drawn: r of each is J z, and what play adds, factored as S = V w V^t.
    A = Jt.T @ Jt
    if S is not None:
        w, V = np.linalg.eigh(S)
        play = np.random.default_rng(DRAWS).standard_normal(r.shape)
        r = r + play @ (V * np.sqrt(np.maximum(w, 0.0))).T
        A = A + S
    A = A + ROUNDING * A.diagonal().max(initial=1e-300) * np.eye(len(A))
    return np.sort((r * np.linalg.solve(A, r.T).T).sum(axis=1))


def drawn_p_value(drawn: Array, chi_square: float) -> float:
    """The fraction of drawn squared lengths, ascending, that are at least as large; never 0, since one more could
    be.
    """
    above = len(drawn) - int(np.searchsorted(drawn, chi_square))
    return (1.0 + above) / (1.0 + len(drawn))


def drawn_radius(observation: Observation, L: Array, free: Array, level: float) -> float:
    """The squared length that a fraction `level` of the errors in free directions, (6 n, f), does not exceed."""
    return float(np.quantile(np.square(_draw(observation, L) @ free).sum(axis=1), level))


def _draw(observation: Observation, L: Array, left_out: tuple[int, ...] = ()) -> Array:
    """Drawn errors as z, (DRAWS, 6 n); those of left-out operations are 0."""
    if observation.tails is None:
        raise ValueError("the observation states no tails")
    joint = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    twists = observation.tails.draws(joint, DRAWS)
    twists[:, list(left_out)] = 0.0
    return whiten_twists(L, twists)
