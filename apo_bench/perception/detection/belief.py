"""A linear filter of all poses together, in which contacts are measurements.

Contacts are without noise but for play, and are taken one after the other. The filter serves to tell which contacts go
together; the correction itself is not its business.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Observation, Poses, compute_joint_covariance
from apo_bench.geometry import Array, pose


class PartBeliefs(NamedTuple):
    """Every part after an operation."""

    poses: Poses
    reach: Mapping[str, Array]
    """Part -> (6, 6 n): the world twist (v, w), about the origin, that body twists of all poses make of its pose."""


@final
@dataclass(frozen=True, eq=False)
class Belief:
    """Poses with one covariance over all of them; the assembly gives who moves and who is carried, no contact."""

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4), world frame, [m]."""
    covariance: Array
    """(6 n, 6 n), of the body twists by which the poses are wrong, [m, rad]."""

    def standing(self, k: int) -> PartBeliefs:
        """Where every part is after operation k, counted from 0, and what errors of the poses do to it.

        With D' = T D_m^-1 D_s of a carried part, and exp(w) D a displaced D: w' = Ad(T) xi + Ad(T D_m^-1) (w_s - w_m).
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

    def condition(self, e: Array, J: Array, noise: Array) -> "Belief":
        """The belief after learning that some quantities, now e (r,) with derivative J (r, 6 n), are zero up to noise.

        Args:
            noise: (r, r), covariance of what the quantities really are.
        """
        # Kalman's update: K = P J^t (J P J^t + S)^-1, xi = -K e, P - K J P; symmetric again after rounding.
        PJ = self.covariance @ J.T
        K = np.linalg.solve(J @ PJ + noise, PJ.T).T
        covariance = self.covariance - K @ PJ.T
        poses = self.poses @ pose.exp(-(K @ e).reshape(-1, 6))
        return Belief(self.assembly, self.start, poses, (covariance + covariance.T) / 2)


def initial_belief(observation: Observation) -> Belief:
    """What an observation says before any contact is known."""
    covariance = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    return Belief(observation.assembly, observation.start, observation.poses, covariance)
