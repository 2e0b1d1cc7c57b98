"""A Kalman filter over all poses together, in which each contact is a measurement.

The detector uses it to judge which contacts are consistent with each other. The correction does not use it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Observation, Poses, compute_joint_covariance
from apo_bench.geometry import Array, pose


class PartBeliefs(NamedTuple):
    """Estimated poses of all parts after one operation, and how they depend on errors of the observed poses."""

    poses: Poses
    reach: Mapping[str, Array]
    """Part -> (6, 6 n), Jacobian of its twist (v, w) about the world origin, by the body twists of all n poses."""


@final
@dataclass(frozen=True, eq=False)
class PoseBelief:
    """A Gaussian estimate of all poses, with one joint covariance.

    The assembly states which parts an operation moves and carries; its contacts are not used.
    """

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4), world frame, [m]."""
    covariance: Array
    """(6 n, 6 n), covariance of the body twists of the pose errors, [m, rad]."""

    def parts_after(self, k: int) -> PartBeliefs:
        """The poses of all parts after operation k, counted from 0, and their Jacobians by errors of the poses.

        A carried part s at D_s, with the main part m moved from D_m to T, comes to D' = T D_m^-1 D_s. With exp(w) D a
        displaced D, its Jacobian follows from w' = Ad(T) xi + Ad(T D_m^-1) (w_s - w_m).
        """
        n = len(self.poses)
        poses = dict(self.start)
        reach = {part: np.zeros((6, 6 * n)) for part in poses}
        for i, (operation, T) in enumerate(zip(self.assembly.operations[: k + 1], self.poses, strict=False)):
            # A body twist xi of pose T is the world twist Ad(T) xi; what is carried moves on as the main part does.
            own = np.zeros((6, 6 * n))
            own[:, 6 * i : 6 * i + 6] = pose.adjoint(T)
            by = T @ pose.inverse(poses[operation.main])
            for part in operation.carries:
                poses[part] = by @ poses[part]
                reach[part] = own + pose.adjoint(by) @ (reach[part] - reach[operation.main])
            poses[operation.main] = T
            reach[operation.main] = own
        return PartBeliefs(poses, reach)

    def update(self, e: Array, J: Array, noise: Array) -> "PoseBelief":
        """The belief after a Kalman update with the measurement that a residual is zero up to noise.

        Args:
            e: (r,), the residual at the current poses.
            J: (r, 6 n), derivative of the residual by the body twists of all poses.
            noise: (r, r), covariance of the true residual.
        """
        # Kalman's update: K = P J^t (J P J^t + S)^-1, xi = -K e, P - K J P; symmetric again after rounding.
        PJ = self.covariance @ J.T
        K = np.linalg.solve(J @ PJ + noise, PJ.T).T
        covariance = self.covariance - K @ PJ.T
        poses = self.poses @ pose.exp(-(K @ e).reshape(-1, 6))
        return PoseBelief(self.assembly, self.start, poses, (covariance + covariance.T) / 2)


def make_initial_belief(observation: Observation) -> PoseBelief:
    """The belief before any contact: the observed poses and their stated joint covariance."""
    covariance = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    return PoseBelief(observation.assembly, observation.start, observation.poses, covariance)
