"""A baseline: soft contacts and a soft prior in one sum of squares, as a general solver takes them.

The cost is  sum (e / CONTACT_M)^2 + sum |z_k|^2,  with e of every contact ever made and z_k = L_k^-1 xi_k, the twist
of pose k in units of its stated covariance L_k L_k^t. It is minimised by `scipy.optimize.least_squares`: trust region
reflective (Branch, Coleman and Li, 1999), analytic Jacobian, dense, begun at what was observed, until steps, cost or
gradient are below 1e-12, or after `EVALUATIONS`. As contacts are soft they hold within about
CONTACT_M^2 / (standard deviation of the noise) only. Made for some tens of operations: matrices are dense.
"""

import numpy as np

from apo_bench.assembly import Correction, Observation, build_contact_equations
from apo_bench.correction.checks.as_given import run_method
from apo_bench.correction.solvers.whitened import whitened
from apo_bench.geometry import Array

CONTACT_M = 1e-6
"""Assumed standard deviation of a contact, tuned, [m]."""
_TOLERANCE = 1e-12
"""Tolerance of steps, cost and gradient."""
EVALUATIONS = 300
"""Most evaluations of the cost."""


def least_squares(observation: Observation, *, contact_m: float = CONTACT_M) -> Correction:
    """The poses with the least sum of squares of contact errors and corrections.

    Args:
        contact_m: Standard deviation of e, [m].

    Returns:
        `converged` with the remaining gap in the sentence, or `not_seen`; `not_finite` if a number overflowed.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return run_method(
        observation, lambda observation: _solve(observation, contact_m), "the least sum of squares was looked for"
    )


def _solve(observation: Observation, contact_m: float) -> Array:
    """The poses, (n, 4, 4), that minimise the cost."""
    from scipy.optimize import least_squares as minimised

    space = whitened(observation)
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    prior = np.eye(6 * len(observation.poses))

    def residual(z: Array) -> Array:
        return np.concatenate([system.residual(space.poses(z)) / contact_m, z])

    def jacobian(z: Array) -> Array:
        _, J = system.linearise(space.poses(z))
        return np.concatenate([space.pull_back(z, J) / contact_m, prior])

    settings = {"xtol": _TOLERANCE, "ftol": _TOLERANCE, "gtol": _TOLERANCE, "max_nfev": EVALUATIONS}
    return space.poses(minimised(residual, np.zeros(len(prior)), jacobian, method="trf", **settings).x)
