"""Errors that several operations share, such as a displaced camera or a model with a wrong origin.

A shared error is a twist c with a covariance, in a stated frame. It takes the observed poses to the true ones: as the
body twist of operation k it is A_k c, T_k = T_observed_k exp(A_k c), with

    A_k = Ad(T_observed_k^-1 P)     in a frame P of the world, which holds for errors of any size,
    A_k = Ad of a turn alone        in the axes of P, at the origin of each part (`local`),
    A_k = 1                         in the frame of each part itself (no frame).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array, freeze, make_copyable, pose


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class SharedError:
    """The part of the errors of some operations that is the same in all of them, or correlated."""

    name: str
    """Source of the error: `camera`, or the name of a part."""
    operations: tuple[int, ...]
    """The m operations that share it, counted from 0."""
    covariance: Array
    """(6, 6), of the twist c, [m, rad]; included in the covariance that each of these operations states."""
    frame: Array | None = None
    """(4, 4), P, world, [m]; None: the frame of each part."""
    local: bool = False
    """Whether only the axes of `frame` count, at the origin of each part."""
    correlation: Array | None = None
    """(m, m): correlation between the twists of the m operations; None: one and the same twist."""

    def __post_init__(self) -> None:
        operations = tuple(int(k) for k in self.operations)
        m = len(operations)
        if m != len(set(operations)) or min(operations, default=0) < 0:
            raise ValueError(f"each operation once, counted from 0, is needed, {operations} was given")
        object.__setattr__(self, "operations", operations)
        freeze(self, covariance=(6, 6), frame=(4, 4), correlation=(m, m))

    def jacobians(self, poses: Array) -> Array:
        """A_k of the operations that share the error, (m, 6, 6).

        Args:
            poses: The observed poses of all operations, (n, 4, 4), world, [m].
        """
        observed = poses[list(self.operations)]
        if self.frame is None:
            return np.broadcast_to(np.eye(6), (len(observed), 6, 6))
        relative = pose.inverse(observed) @ self.frame
        if self.local:
            relative[:, :3, 3] = 0.0
        return pose.adjoint(relative)

    def covariances(self, poses: Array) -> Array:
        """The contribution to the covariance of the body twists of the operations that share the error, (m, 6, 6)."""
        A = self.jacobians(poses)
        C = A @ self.covariance @ np.swapaxes(A, 1, 2)
        return np.asarray((C + np.swapaxes(C, 1, 2)) / 2)


def compute_joint_covariance(poses: Array, covariance: Array, shared: Sequence[SharedError]) -> Array:
    """The joint covariance of the body twists of all operations, (6 n, 6 n), [m, rad].

    Args:
        poses: (n, 4, 4), the observed poses.
        covariance: (n, 6, 6), of each operation by itself.
    """
    n = len(poses)
    joint = np.zeros((n, 6, n, 6))
    components = np.arange(6)
    for error in shared:
        k = np.array(error.operations, dtype=np.intp)
        A = error.jacobians(poses)
        # The twists of operations k and l are A_k c and A_l c, so their covariance is A_k C A_l^t.
        covariance_between = np.einsum("kab,bc,ldc->kald", A, error.covariance, A)
        if error.correlation is not None:
            covariance_between *= error.correlation[:, None, :, None]
        joint[np.ix_(k, components, k, components)] += covariance_between
    joint[np.arange(n), :, np.arange(n)] = covariance  # it includes the shared part already
    matrix = joint.reshape(6 * n, 6 * n)
    return np.asarray((matrix + matrix.T) / 2)


def correlate_first_order(m: int, correlation: float) -> Array:
    """The correlation matrix of a first-order autoregression, (m, m): correlation^|i - j|."""
    steps = np.arange(m)
    return np.asarray(correlation ** np.abs(steps[:, None] - steps))
