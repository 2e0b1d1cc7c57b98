"""Forward model of a robot with calibration errors: true poses of tip and held parts, with derivatives.

    T_world_part = E B exp(J delta) shift(tau) exp(gamma) T_tip_part,  E = M exp(xi) M^-1

B is the assumed pose of the tip. xi is the displacement between hand and eye, a twist at the middle of the poses (M is
the shift there). delta are the offsets of the encoders, J is the body Jacobian at B, tau the offset of the tool. gamma
is the slip of the part in the hand, a twist in the frame of the tip. The vector of unknowns is (xi, tau, delta, gamma
of the first grasp, of the second, ..), [m, rad].
"""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, Ints, compute_exp_and_jacobian, pose

HAND_EYE = slice(0, 6)
"""Indices of xi among the unknowns."""
TOOL = slice(6, 9)
"""Indices of tau among the unknowns."""


class Places(NamedTuple):
    """t assumed poses of the tip, or of what the robot holds."""

    T_world_tip: Array
    """(t, 4, 4): B, [m]."""
    jacobian: Array
    """(t, 6, joints), [m/rad, rad/rad]; zeros: the encoders count as exact."""
    T_tip_part: Array
    """(t, 4, 4), [m]: the assumed pose of the part; the identity for the tip."""
    grasp: Ints
    """(t,): index of the grasp, from 0; -1: the hand is empty."""


def joints_in(joints: int) -> slice:
    """Indices of the encoder offsets among the unknowns."""
    return slice(TOOL.stop, TOOL.stop + joints)


def grasp_in(joints: int, k: int) -> slice:
    """Indices of the twist of grasp k, from 0, among the unknowns."""
    first = TOOL.stop + joints + 6 * k
    return slice(first, first + 6)


def hand_eye_displacement(unknowns: Array, middle: Array) -> Array:
    """The displacement E, (4, 4), from the unknowns."""
    M = pose.rigid(np.eye(3), middle)
    return np.asarray(M @ pose.exp(unknowns[HAND_EYE]) @ pose.inverse(M))


def tip_displacement(unknowns: Array, J: Array) -> Array:
    """exp(J delta) shift(tau), (4, 4): from the assumed to the true pose of the tip, without E."""
    return np.asarray(pose.exp(J @ unknowns[joints_in(J.shape[1])]) @ pose.rigid(np.eye(3), unknowns[TOOL]))


def compute_part_poses(unknowns: Array, middle: Array, places: Places) -> tuple[Array, Array]:
    """The true poses of the parts, and the derivatives of their body twists by the unknowns.

    Args:
        unknowns: (u,).
        middle: (3,), [m], world frame.

    Returns:
        T_world_part, (t, 4, 4), and D, (t, 6, u): adding d to the unknowns makes the pose T_world_part exp(D d).
    """
    B, J, T_tip_part, grasp = places
    M = pose.rigid(np.eye(3), middle)
    joints = joints_in(J.shape[2])
    holds = np.flatnonzero(grasp >= 0)
    columns = (joints.stop + 6 * grasp[:, None] + np.arange(6))[holds]
    gamma = np.zeros((len(grasp), 6))
    gamma[holds] = unknowns[columns]
    turned, D_xi = compute_exp_and_jacobian(unknowns[HAND_EYE])
    moved, D_delta = compute_exp_and_jacobian(J @ unknowns[joints])
    slipped, D_gamma = compute_exp_and_jacobian(gamma)
    D = np.zeros((len(grasp), 6, len(unknowns)))
    # From the last factor of the product to the first: a twist x before T is the twist Ad(T^-1) x behind T.
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
    """The twists behind T, (t, 6, k), that are equivalent to twists before it."""
    return np.asarray(pose.adjoint(pose.inverse(T)) @ twists)
