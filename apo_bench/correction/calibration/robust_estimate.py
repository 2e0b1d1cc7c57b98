"""Most probable calibration errors given touches, and rejection of touches that contradict the others.

Maximum a posteriori with Gaussian priors and touches: minimises the squares of z and of the residual of each touch over
its sigma, where the unknowns are the prior sigmas times z. Solved by Gauss-Newton, with all touches each time.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.probing_touch import Touch
from apo_bench.correction.calibration.robot_model import Places, compute_part_poses
from apo_bench.geometry import Array, pose

REFUSED_BEYOND = 5.0
"""A touch is rejected if its deviation from the prediction of all others and the priors exceeds this, in standard
deviations."""
_MOST_STEPS = 2000
"""Most Gauss-Newton steps."""
_SMALL = 1e-9
"""Size of the step after which the solver has converged, in prior standard deviations."""
_ROUNDING = 1e-14
"""Relative increase of the sum of squares that counts as rounding."""


class NumberedTouch(NamedTuple):
    """A touch with the index of its grasp, from 0; -1: the hand was empty."""

    touch: Touch
    grasp: int


class Estimate(NamedTuple):
    """The most probable unknowns, (u,), their covariance, (u, u), and which touches were taken, (t,)."""

    mean: Array
    covariance: Array
    taken: NDArray[np.bool_]


class TouchEquations(NamedTuple):
    """t touches: n . (T_world_part v) = d, each with its sigma."""

    places: Places
    normals: Array
    """(t, 3)."""
    points: Array
    """(t, 3), [m]."""
    offsets: Array
    """(t,), [m]."""
    sigmas: Array
    """(t,), [m]."""


def robust_estimate(felt: tuple[NumberedTouch, ...], sigmas: Array, joints: int, middle: Array) -> Estimate:
    """Estimate the unknowns from all touches but those that contradict the others and the priors.

    While a touch deviates by more than `REFUSED_BEYOND` from the prediction of all others, the worst one is left out.
    Then touches that fit again without it are taken back, the best one first. All touches are judged again in each
    call, so their order does not matter.

    Args:
        sigmas: (u,): prior standard deviations of the unknowns, [m, rad].
        middle: (3,): as in `robot_model`.
    """

    def solved(taken: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """z, A, and how far each touch is from what the others predict."""
        kept = [one for one, counts in zip(felt, taken, strict=True) if counts]
        z, A, y = _most_probable(_equations(kept, joints), sigmas, middle)
        return z, A, _surprises(A, y)

    taken = np.ones(len(felt), dtype=np.bool_)
    z, A, surprises = solved(taken)
    while surprises.max(initial=0.0) > REFUSED_BEYOND:
        taken[np.flatnonzero(taken)[int(np.argmax(surprises))]] = False
        z, A, surprises = solved(taken)
    while not taken.all():
        more = [taken | (np.arange(len(felt)) == i) for i in np.flatnonzero(~taken)]
        again = [solved(each) for each in more]
        worst = [one[2].max() for one in again]
        best = int(np.argmin(worst))
        if worst[best] > REFUSED_BEYOND:
            break
        taken = more[best]
        z, A, surprises = again[best]
    spread = sigmas[:, None] * np.linalg.inv(_triangle(A))
    return Estimate(sigmas * z, spread @ spread.T, taken)


def _equations(felt: list[NumberedTouch], joints: int) -> TouchEquations:
    """Stack touches into arrays."""
    t = len(felt)
    exact = np.zeros((6, joints))
    touches = [touch for touch, _ in felt]
    places = Places(
        np.array([touch.T_world_tip for touch in touches]).reshape(t, 4, 4),
        np.array([exact if touch.jacobian is None else touch.jacobian for touch in touches]).reshape(t, 6, joints),
        np.array([np.eye(4) if touch.T_tip_part is None else touch.T_tip_part for touch in touches]).reshape(t, 4, 4),
        np.array([grasp for _, grasp in felt], dtype=np.int64),
    )
    return TouchEquations(
        places,
        np.array([touch.normal for touch in touches]).reshape(t, 3),
        np.array([touch.point for touch in touches]).reshape(t, 3),
        np.array([touch.offset for touch in touches]),
        np.array([touch.sigma_m for touch in touches]),
    )


def _most_probable(equations: TouchEquations, sigmas: Array, middle: Array) -> tuple[Array, Array, Array]:
    """The z that minimises |z|^2 + |residuals|^2, with A and y of the residuals near it, A z - y."""
    z = np.zeros(len(sigmas))
    A, y = _linearise(equations, sigmas, middle, z)
    for _ in range(_MOST_STEPS):
        before = z
        R = _triangle(A)
        most = _sum(z, A, y) * (1.0 + _ROUNDING)
        z = np.linalg.solve(R, np.linalg.solve(R.T, A.T @ y))
        A, y = _linearise(equations, sigmas, middle, z)
        while _sum(z, A, y) > most and np.abs(z - before).max() >= _SMALL:  # too far: half the way
            z = 0.5 * (before + z)
            A, y = _linearise(equations, sigmas, middle, z)
        if np.abs(z - before).max() < _SMALL:
            break
    return z, A, y


def _sum(z: Array, A: Array, y: Array) -> float:
    """The sum of squares that is minimised, at z, with A and y linearised there."""
    off = A @ z - y
    return float(z @ z + off @ off)


def _linearise(equations: TouchEquations, sigmas: Array, middle: Array, z: Array) -> tuple[Array, Array]:
    """A (t, u) and y (t,): near z the residual of each touch, over its sigma, is A z - y."""
    T, D = compute_part_poses(sigmas * z, middle, equations.places)
    points = equations.points[:, :, None]
    R = T[:, :3, :3]
    off = (equations.normals * (R @ points + T[:, :3, 3:])[..., 0]).sum(axis=1) - equations.offsets
    # a body twist (v, w) moves a point by R (v + w x point)
    moves = R @ (D[:, :3] - pose.hat(equations.points) @ D[:, 3:])
    A = (equations.normals[:, None] @ moves)[:, 0] * sigmas / equations.sigmas[:, None]
    return A, A @ z - off / equations.sigmas


def _triangle(A: Array) -> Array:
    """R, (u, u), with R^t R = 1 + A^t A."""
    return np.asarray(np.linalg.qr(np.vstack([A, np.eye(A.shape[1])]), mode="r"))


def _surprises(A: Array, y: Array) -> Array:
    """The deviation of each y from the prediction of the others, (t,), in standard deviations of that.

    A priori y has the covariance S = 1 + A A^t. Given the others, y_i is off by (S^-1 y)_i / (S^-1)_ii, of which the
    variance is 1 / (S^-1)_ii.
    """
    inverse = np.linalg.inv(np.eye(len(A)) + A @ A.T)
    return np.asarray(np.abs(inverse @ y) / np.sqrt(np.diag(inverse)))
