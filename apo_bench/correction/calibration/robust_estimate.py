"""The unknowns of a robot that are most probable after touches, and which touches to refuse.

Maximum a posteriori of Gaussian priors and Gaussian touches: the smallest sum of squares of z and of what each touch
is off over its sigma, where the unknowns are the sigmas times z; Gauss-Newton, all touches anew each time.

Where a robot that is wrong really goes: the forward model of its unknowns, with its derivative.

    T_world_part = E B exp(J delta) shift(tau) exp(gamma) T_tip_part,  E = M exp(xi) M^-1

B is where the robot believes its tip, xi the displacement between hand and eye, a twist at the middle of the goals
(M is the shift there), delta the zeros of the encoders, J the body Jacobian at B, tau the shift of the tool, and gamma
how the part moved in the hand, a twist in the frame of the tip. The vector of unknowns is (xi, tau, delta, gamma of
the first grasp, of the second, ..), [m, rad].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.touch import Touch
from apo_bench.geometry import Array, Ints, exp_and_jacobian, pose

HAND_EYE = slice(0, 6)
TOOL = slice(6, 9)


class Places(NamedTuple):
    """t places of what a robot holds, or of its tip."""

    T_world_tip: Array
    """(t, 4, 4): B, [m]."""
    jacobian: Array
    """(t, 6, joints), [m/rad, rad/rad]; zeros: as if the encoders were exact."""
    T_tip_part: Array
    """(t, 4, 4), [m]: where the part is believed; the identity for the tip."""
    grasp: Ints
    """(t,): which of the grasps that were made, from 0; -1: the hand is empty."""


def joints_in(joints: int) -> slice:
    """Where the zeros of the encoders stand among the unknowns."""
    return slice(TOOL.stop, TOOL.stop + joints)


def grasp_in(joints: int, k: int) -> slice:
    """Where the twist of the k-th grasp that was made, from 0, stands among the unknowns."""
    first = TOOL.stop + joints + 6 * k
    return slice(first, first + 6)


def hand_eye_displacement(unknowns: Array, middle: Array) -> Array:
    """E, (4, 4)."""
    M = pose.rigid(np.eye(3), middle)
    return np.asarray(M @ pose.exp(unknowns[HAND_EYE]) @ pose.inverse(M))


def tip_displacement(unknowns: Array, J: Array) -> Array:
    """exp(J delta) shift(tau), (4, 4): from where the robot believes its tip to where it is, but for E."""
    return np.asarray(pose.exp(J @ unknowns[joints_in(J.shape[1])]) @ pose.rigid(np.eye(3), unknowns[TOOL]))


def part_poses(unknowns: Array, middle: Array, places: Places) -> tuple[Array, Array]:
    """Where the parts really are, and how their body twists depend on the unknowns.

    Args:
        unknowns: (u,).
        middle: (3,), [m], world frame.

    Returns:
        T_world_part, (t, 4, 4), and D, (t, 6, u): unknowns that are more by d make it T_world_part exp(D d).
    """
    B, J, T_tip_part, grasp = places
    M = pose.rigid(np.eye(3), middle)
    joints = joints_in(J.shape[2])
    holds = np.flatnonzero(grasp >= 0)
    columns = (joints.stop + 6 * grasp[:, None] + np.arange(6))[holds]
    gamma = np.zeros((len(grasp), 6))
    gamma[holds] = unknowns[columns]
    turned, D_xi = exp_and_jacobian(unknowns[HAND_EYE])
    moved, D_delta = exp_and_jacobian(J @ unknowns[joints])
    slipped, D_gamma = exp_and_jacobian(gamma)
    D = np.zeros((len(grasp), 6, len(unknowns)))
    # From the last factor of the product to the first: a twist before T is the twist Ad(T^-1) of it behind T.
    T = T_tip_part
    D[holds[:, None], :, columns] = np.swapaxes(_behind(T, D_gamma)[holds], 1, 2)
    T = slipped @ T
    D[:, :, TOOL] = _behind(T, np.eye(6)[:, :3])
    T = pose.rigid(np.eye(3), unknowns[TOOL]) @ T
    D[:, :, joints] = _behind(T, D_delta @ J)
    T = pose.inverse(M) @ B @ moved @ T
    D[:, :, HAND_EYE] = _behind(T, D_xi)
    return M @ turned @ T, D


def _behind(T: Array, twists: Array) -> Array:
    """The twists behind T, (t, 6, k), that do what twists before it do."""
    return np.asarray(pose.adjoint(pose.inverse(T)) @ twists)


REFUSED_BEYOND = 5.0
"""A touch that all others and the priors foretell so badly, in standard deviations, is refused."""
_MOST_STEPS = 2000
_SMALL = 1e-9
"""The last step, in prior standard deviations."""
_ROUNDING = 1e-14
"""A sum that is larger by no more than this part is the same."""


class NumberedTouch(NamedTuple):
    """A touch, and which of the grasps that were made it is of, from 0; -1: the hand was empty."""

    touch: Touch
    grasp: int


class Estimate(NamedTuple):
    """The most probable unknowns, (u,), their covariance, (u, u), and which touches were taken, (t,)."""

    mean: Array
    covariance: Array
    taken: NDArray[np.bool_]


class Equations(NamedTuple):
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
    """What all touches tell, but for those that contradict the others and the priors.

    As long as a touch is farther off than `REFUSED_BEYOND` standard deviations of what all others and the priors
    foretell, the worst one is left out. Then those that fit again, as a worse one is gone, are taken back, the best one
    first. All touches are judged anew each time, so their order does not matter, and a touch that was refused counts
    as soon as others agree with it.

    Args:
        sigmas: (u,): prior standard deviations of the unknowns, [m, rad].
        middle: (3,): as in `robot_model`.
    """

    def solved(taken: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """z, A, and how far each touch is from what the others foretell."""
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


def _equations(felt: list[NumberedTouch], joints: int) -> Equations:
    t = len(felt)
    exact = np.zeros((6, joints))
    touches = [touch for touch, _ in felt]
    places = Places(
        np.array([touch.T_world_tip for touch in touches]).reshape(t, 4, 4),
        np.array([exact if touch.jacobian is None else touch.jacobian for touch in touches]).reshape(t, 6, joints),
        np.array([np.eye(4) if touch.T_tip_part is None else touch.T_tip_part for touch in touches]).reshape(t, 4, 4),
        np.array([grasp for _, grasp in felt], dtype=np.int64),
    )
    return Equations(
        places,
        np.array([touch.normal for touch in touches]).reshape(t, 3),
        np.array([touch.point for touch in touches]).reshape(t, 3),
        np.array([touch.offset for touch in touches]),
        np.array([touch.sigma_m for touch in touches]),
    )


def _most_probable(equations: Equations, sigmas: Array, middle: Array) -> tuple[Array, Array, Array]:
    """The z that minimises |z|^2 + |residuals|^2, and the residuals near it, A z - y."""
    z = np.zeros(len(sigmas))
    A, y = _linearised(equations, sigmas, middle, z)
    for _ in range(_MOST_STEPS):
        before = z
        R = _triangle(A)
        most = _sum(z, A, y) * (1.0 + _ROUNDING)
        z = np.linalg.solve(R, np.linalg.solve(R.T, A.T @ y))
        A, y = _linearised(equations, sigmas, middle, z)
        while _sum(z, A, y) > most and np.abs(z - before).max() >= _SMALL:  # too far: half the way
            z = 0.5 * (before + z)
            A, y = _linearised(equations, sigmas, middle, z)
        if np.abs(z - before).max() < _SMALL:
            break
    return z, A, y


def _sum(z: Array, A: Array, y: Array) -> float:
    """What is minimised, at z itself."""
    off = A @ z - y
    return float(z @ z + off @ off)


def _linearised(equations: Equations, sigmas: Array, middle: Array, z: Array) -> tuple[Array, Array]:
    """A (t, u) and y (t,): near z the residual of each touch, over its sigma, is A z - y."""
    T, D = part_poses(sigmas * z, middle, equations.places)
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
    """How far each y is from what the others foretell, (t,), in standard deviations of that.

    A priori y has the covariance S = 1 + A A^t. Given the others, y_i is off by (S^-1 y)_i / (S^-1)_ii, of which the
    variance is 1 / (S^-1)_ii.
    """
    inverse = np.linalg.inv(np.eye(len(A)) + A @ A.T)
    return np.asarray(np.abs(inverse @ y) / np.sqrt(np.diag(inverse)))
