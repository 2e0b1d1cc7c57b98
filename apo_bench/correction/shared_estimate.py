"""Estimates of errors that operations share, such as a camera offset, given a correction."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Observation, SharedError, compute_joint_covariance
from apo_bench.correction.solvers import (
    CompactEquations,
    compute_freedom,
    factor_noise,
    linearise_by,
    unwhiten_twists,
)
from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose


@final
@dataclass(frozen=True, eq=False)
class SharedEstimate:
    """The estimate of one shared error."""

    error: SharedError
    twist: Array
    """(6,), [m, rad], in its frame: the estimated error of the observation, the opposite of what leads to the truth."""
    covariance: Array
    """(6, 6), posterior covariance of `twist`."""

    @property
    def deviations(self) -> Array:
        """Posterior standard deviations, (6,), [m, rad]."""
        return np.sqrt(np.diag(self.covariance))


def estimate_shared(
    observation: Observation, xi: Array, Jr: Array, system: CompactEquations
) -> tuple[tuple[SharedEstimate, ...], Array]:
    """Estimate the errors that operations share, and the joint uncertainty of all poses.

    Shared error c and body twists xi are jointly Gaussian, cov(c, xi_k) = C A_k^t. Given the corrected twists, c has
    the mean K xi and the covariance C - K A C, with K = C A^t S^-1. The uncertainty of the twists themselves is added.

    Args:
        xi: (n, 6), the body twists from the observed to the corrected poses, [m, rad].
        Jr: (n, 6, 6), their right Jacobians.
        system: The equations that hold.

    Returns:
        One estimate for each shared error that is no mere correlation. And a factor F, (n, 6, f), of the posterior: F_k
        F_l^t is the covariance of the body twists of corrected poses k and l.

    Raises:
        InputError: Too many operations.
    """
    L = factor_noise(observation)
    seen = observation.poses
    known = compute_freedom(linearise_by(system, seen @ pose.exp(xi), Jr @ L)[1])
    if known is None:
        raise InputError(f"{len(seen)} operations that share errors were given; take fewer of them.")
    joint = compute_joint_covariance(seen, observation.covariance, observation.shared)
    free = L.reshape(xi.size, xi.size) @ known.free
    estimates = []
    for error in observation.shared:
        if error.correlation is not None:
            continue
        # Rows of A: what the shared error makes of the twist of each operation.
        A = np.zeros((len(seen), 6, 6))
        A[list(error.operations)] = error.jacobians(seen)
        AC = A.reshape(xi.size, 6) @ error.covariance
        K = np.linalg.solve(joint, AC).T
        C = error.covariance - K @ AC + (K @ free) @ (K @ free).T
        estimates.append(SharedEstimate(error, -(K @ xi.ravel()), (C + C.T) / 2))
    return tuple(estimates), unwhiten_twists(Jr @ L, known.free)
