"""The test and the regions of a correction where errors have tails: by draws of the noise that is stated.

Near the solution everything is linear: the squared length of a correction is that of what the observation is off by in
the directions that contacts fix, and the poses are off by the rest. So both are drawn with the noise, and observed
numbers are compared with drawn ones (Monte Carlo p-value; Davison and Hinkley, "Bootstrap Methods and their
Application", 1997, Section 4.2).
"""

import numpy as np

from apo_bench.assembly import Observation, compute_joint_covariance
from apo_bench.correction.checks.chi_square import ROUNDING
from apo_bench.correction.solvers import (
    whiten_twists,
)
from apo_bench.geometry import Array

DRAWS = 2000


def drawn_chi_squares(
    observation: Observation, L: Array, Jt: Array, S: Array | None, left_out: tuple[int, ...] = ()
) -> Array:
    """Squared lengths of corrections of errors that are drawn, (DRAWS,), sorted.

    Args:
        L: As of `factor_noise`.
        Jt: (6 n, 3 c), the transposed derivative of the equations by z, at a solution.
        S: (3 c, 3 c), the covariance of what equations are off by, [m^2]; None: nothing.
        left_out: Operations whose poses are inferred, so that they agree with their contacts.
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
    """The part of drawn squared lengths, sorted, that are not less; never 0, since one more might be."""
    above = len(drawn) - int(np.searchsorted(drawn, chi_square))
    return (1.0 + above) / (1.0 + len(drawn))


def drawn_radius(observation: Observation, L: Array, free: Array, level: float) -> float:
    """The squared length within which a part `level` of errors in the free directions are, (6 n, f), of z."""
    return float(np.quantile(np.square(_draw(observation, L) @ free).sum(axis=1), level))


def _draw(observation: Observation, L: Array, left_out: tuple[int, ...] = ()) -> Array:
    """z of errors, (DRAWS, 6 n); of operations that are left out of none."""
    if observation.tails is None:
        raise ValueError("the observation states no tails")
    joint = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    twists = observation.tails.draws(joint, DRAWS)
    twists[:, list(left_out)] = 0.0
    return whiten_twists(L, twists)
