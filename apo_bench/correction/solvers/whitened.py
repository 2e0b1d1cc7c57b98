"""Pose corrections in units of the stated noise: z = L^-1 xi, with covariance L L^t; |z| is the Mahalanobis length.

If errors of operations are independent, L has a block for each, (n, 6, 6), and six components of z belong to each
operation. If they share errors, L is the factor of their joint covariance, (n, 6, 6 n), six rows for each operation.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Observation, compute_joint_covariance
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, compute_right_jacobian, pose


@final
@dataclass(frozen=True, eq=False)
class WhitenedPoses:
    """The poses of n operations as a vector z, (6 n,), which is zero at the observed poses."""

    observed: Array
    """(n, 4, 4), world frame, [m]."""
    factor: Array
    """(n, 6, 6) or (n, 6, 6 n), L, [m, rad]."""

    def poses(self, z: Array) -> Array:
        """T_observed exp(L z), (n, 4, 4)."""
        return np.asarray(self.observed @ pose.exp(unwhiten_twists(self.factor, z)))

    def pull_back(self, z: Array, J: Array) -> Array:
        """Convert a derivative by the body twists of the poses at z, (m, 6 n), to the derivative by z."""
        return pull_back(J, compute_right_jacobian(unwhiten_twists(self.factor, z)) @ self.factor)


def whitened(observation: Observation) -> WhitenedPoses:
    """The whitened coordinates of an observation.

    Raises:
        InputError: A covariance is not positive definite.
    """
    return WhitenedPoses(observation.poses, factor_noise(observation))


def unwhiten_twists(L: Array, z: Array) -> Array:
    """L z by operation: z (6 n,) -> (n, 6), or (6 n, f) -> (n, 6, f)."""
    n = len(L)
    columns = z.shape[1:]
    if L.shape[2] != 6:
        return np.asarray((L.reshape(6 * n, len(z)) @ z).reshape(n, 6, *columns))
    return np.asarray((L @ z.reshape(n, 6, *(columns or (1,)))).reshape(n, 6, *columns))


def whiten_twists(L: Array, xi: Array) -> Array:
    """The z with L z = xi, (*, n, 6) -> (*, 6 n)."""
    flat = (*xi.shape[:-2], 6 * len(L))
    if L.shape[2] != 6:
        return np.asarray(np.linalg.solve(L.reshape(flat[-1], flat[-1]), xi.reshape(*flat, 1))[..., 0])
    return np.asarray(np.linalg.solve(L, xi[..., None]).reshape(flat))


def pull_back(J: Array, B: Array) -> Array:
    """Convert a derivative by body twists, (m, 6 n), to one by z, (m, 6 n), if the body twists are B z."""
    m = len(J)
    n = len(B)
    if B.shape[2] != 6:
        return np.asarray(J.reshape(m, 6 * n) @ B.reshape(6 * n, 6 * n))
    return np.asarray((J.reshape(m, n, 1, 6) @ B).reshape(m, 6 * n))


def factor_noise(observation: Observation) -> Array:
    """The factor L of the noise, (n, 6, 6), or (n, 6, 6 n) if operations share errors.

    Raises:
        InputError: A covariance is not positive definite, or shared errors are larger than the covariances that contain
            them.
    """
    # Shared errors couple the operations, so L is then the factor of their joint covariance.
    if not observation.shared:
        return factor_covariance(observation.covariance)
    factor_covariance(observation.covariance)
    n = len(observation.poses)
    joint = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    try:
        return np.asarray(np.linalg.cholesky(joint).reshape(n, 6, 6 * n), dtype=np.float64)
    except np.linalg.LinAlgError:
        names = ", ".join(f"'{one.name}'" for one in observation.shared)
        raise InputError(
            f"the shared errors {names} are larger than the covariances of their operations; state covariances that "
            "contain them, and more than them in every direction."
        ) from None


def whiten_poses(observed: Array, L: Array, poses: Array) -> Array:
    """The shortest z that leads from the observed poses, (n, 4, 4), to these, (*, n, 4, 4): (*, 6 n)."""
    return whiten_twists(L, pose.log(pose.inverse(observed) @ poses))


def factor_covariance(covariance: Array) -> Array:
    """L with L L^t = covariance, (n, 6, 6).

    Raises:
        InputError: One is not positive definite.
    """
    try:
        L = np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)
        if np.isfinite(L).all():
            return L
    except np.linalg.LinAlgError:
        pass
    L = np.zeros(covariance.shape)
    for k, C in enumerate(covariance):
        try:
            L[k] = np.linalg.cholesky(C)
        except np.linalg.LinAlgError:
            L[k] = np.nan
        require(
            np.isfinite(L[k]).all(),
            f"the covariance of operation {k + 1} is not positive definite; "
            "state finite numbers and a variance above zero in every direction.",
        )
    return L
