"""The unknowns of a robot that are most probable after touches, and which touches to refuse.

Maximum a posteriori of Gaussian priors and Gaussian touches: the smallest sum of squares of z and of what each touch
is off over its sigma, where the unknowns are the sigmas times z; Gauss-Newton, all touches anew each time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.touches.robot_model import part_pose
from apo_bench.correction.touches.touch import Touch
from apo_bench.geometry import Array, pose

REFUSED_BEYOND = 5.0
"""A touch that all others and the priors foretell so badly, in standard deviations, is refused."""
_MOST_STEPS = 30
_SMALL = 1e-9
"""The last step, in prior standard deviations."""
_ONE = np.eye(4)


class Felt(NamedTuple):
    """A touch with where the twist of its grasp stands among the unknowns; None: the hand was empty."""

    touch: Touch
    gamma: slice | None


class Estimate(NamedTuple):
    """The most probable unknowns, (u,), their covariance, (u, u), and which touches were taken, (t,)."""

    mean: Array
    covariance: Array
    taken: NDArray[np.bool_]


def robust_estimate(felt: tuple[Felt, ...], sigmas: Array, middle: Array) -> Estimate:
    """What all touches tell, but for those that contradict the others and the priors.

    As long as the touch that is foretold worst is farther off than `REFUSED_BEYOND` standard deviations of what is
    foretold, it is left out. All touches are judged anew each time, so their order does not matter, and a touch that
    was refused is taken as soon as others agree with it.

    Args:
        sigmas: (u,): prior standard deviations of the unknowns, [m, rad].
        middle: (3,): as in `robot_model`.
    """
    taken = np.ones(len(felt), dtype=np.bool_)
    while True:
        kept = [one for one, is_taken in zip(felt, taken, strict=True) if is_taken]
        z, A, y = _most_probable(kept, sigmas, middle)
        surprise = _surprises(A, y)
        if not kept or surprise.max() <= REFUSED_BEYOND:
            break
        taken[np.flatnonzero(taken)[int(np.argmax(surprise))]] = False
    spread = sigmas[:, None] * np.linalg.inv(_triangle(A))
    return Estimate(sigmas * z, spread @ spread.T, taken)


def _most_probable(felt: list[Felt], sigmas: Array, middle: Array) -> tuple[Array, Array, Array]:
    """The z that minimises |z|^2 + |residuals|^2, and the residuals there, A z - y."""
    z = np.zeros(len(sigmas))
    for _ in range(_MOST_STEPS):
        A, y = _linearised(felt, sigmas, middle, z)
        R = _triangle(A)
        after = np.linalg.solve(R, np.linalg.solve(R.T, A.T @ y))
        step = np.abs(after - z).max()
        z = after
        if step < _SMALL:
            break
    return z, *_linearised(felt, sigmas, middle, z)


def _linearised(felt: list[Felt], sigmas: Array, middle: Array, z: Array) -> tuple[Array, Array]:
    """A (t, u) and y (t,): near z the residual of each touch, over its sigma, is A z - y."""
    A = np.zeros((len(felt), len(sigmas)))
    off = np.zeros(len(felt))
    for i, (touch, gamma) in enumerate(felt):
        held = _ONE if touch.T_tip_part is None else touch.T_tip_part
        T, D = part_pose(sigmas * z, middle, touch.T_world_tip, touch.jacobian, gamma, held)
        off[i] = (touch.normal @ pose.apply(T, touch.point[None])[0] - touch.offset) / touch.sigma_m
        # a body twist (v, w) moves the point by R (v + w x point)
        moves = D[:3] - pose.hat(touch.point) @ D[3:]
        A[i] = touch.normal @ T[:3, :3] @ moves * sigmas / touch.sigma_m
    return A, A @ z - off


def _triangle(A: Array) -> Array:
    """R, (u, u), with R^t R = 1 + A^t A."""
    return np.asarray(np.linalg.qr(np.vstack([A, np.eye(A.shape[1])]), mode="r"))


def _surprises(A: Array, y: Array) -> Array:
    """How far each y is from what the others foretell, (t,), in standard deviations of that.

    A priori y has the covariance S = 1 + A A^t. Given the others, y_i is off by (S^-1 y)_i / (S^-1)_ii, of which the
    variance is 1 / (S^-1)_ii.
    """
    inverse = np.linalg.inv(np.eye(len(A)) + A @ A.T)
    return np.asarray(np.abs(inverse @ y) / np.sqrt(np.diag(inverse)))
