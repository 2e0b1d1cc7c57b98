"""The errors that operations share, estimated with a correction: how far a camera is off, and how certain that is."""

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
    """What is known of one shared error after a correction."""

    error: SharedError
    twist: Array
    """(6,), [m, rad], in its frame: how far what was observed is off, the opposite of what takes it to the truth."""
    covariance: Array
    """(6, 6), posterior, of that."""

    @property
    def deviations(self) -> Array:
        """Posterior standard deviations, (6,), [m, rad]."""
        return np.sqrt(np.diag(self.covariance))


def estimate_shared(
    observation: Observation, xi: Array, Jr: Array, system: CompactEquations
) -> tuple[tuple[SharedEstimate, ...], Array]:
    """The errors that are one and the same in several operations, and how uncertain all poses are together.

    Shared error c and body twists xi are jointly Gaussian, cov(c, xi_k) = C A_k^t: given the corrected twists, c has
    the mean K xi and the covariance C - K A C, K = C A^t S^-1, to which comes what is uncertain of the twists.

    Args:
        xi: (n, 6), the body twists from what was observed to the corrected poses, [m, rad].
        Jr: (n, 6, 6), their right Jacobians.
        system: The equations that hold.

    Returns:
        One estimate for each shared error that is no mere correlation, and (n, 6, f) of which the products with
        themselves are the posterior covariances of the body twists at the corrected poses.

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
        A[list(error.operations)] = error.ways(seen)
        AC = A.reshape(xi.size, 6) @ error.covariance
        K = np.linalg.solve(joint, AC).T
        C = error.covariance - K @ AC + (K @ free) @ (K @ free).T
        estimates.append(SharedEstimate(error, -(K @ xi.ravel()), (C + C.T) / 2))
    return tuple(estimates), unwhiten_twists(Jr @ L, known.free)
