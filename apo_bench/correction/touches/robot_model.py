"""Where a robot that is wrong really goes: the forward model of its unknowns, with its derivative.

    T_world_part = E B exp(J delta) shift(tau) exp(gamma) T_tip_part,  E = M exp(xi) M^-1

B is where the robot believes its tip, xi the displacement between hand and eye, a twist at the middle of the goals
(M is the shift there), delta the zeros of the encoders, J the body Jacobian at B, tau the shift of the tool, and gamma
how the part moved in the hand, a twist in the frame of the tip. The vector of unknowns is (xi, tau, delta, gamma of
the first grasp, of the second, ..), [m, rad].
"""

import numpy as np

from apo_bench.geometry import Array, exp_and_jacobian, pose

HAND_EYE = slice(0, 6)
TOOL = slice(6, 9)
_ONE = np.eye(4)


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


def tip_displacement(unknowns: Array, J: Array | None) -> Array:
    """exp(J delta) shift(tau), (4, 4): from where the robot believes its tip to where it is, but for E."""
    tool = pose.rigid(np.eye(3), unknowns[TOOL])
    return tool if J is None else np.asarray(pose.exp(J @ unknowns[joints_in(J.shape[1])]) @ tool)


def part_pose(
    unknowns: Array, middle: Array, B: Array, J: Array | None, gamma: slice | None, T_tip_part: Array
) -> tuple[Array, Array]:
    """Where what is held is, and how its body twist depends on the unknowns.

    Args:
        unknowns: (u,).
        middle: (3,), [m], world frame.
        gamma: Where the twist of its grasp stands among the unknowns; None: the hand is empty.

    Returns:
        T_world_part, (4, 4), and D, (6, u): unknowns that are more by d make it T_world_part exp(D d).
    """
    M = pose.rigid(np.eye(3), middle)
    turned, J_xi = exp_and_jacobian(unknowns[HAND_EYE])
    # The factors of the product; behind each that is unknown, the body twist that its unknowns make there.
    factors: list[tuple[Array, slice | None, Array]] = [(turned, HAND_EYE, J_xi), (pose.inverse(M) @ B, None, _ONE)]
    if J is not None:
        columns = joints_in(J.shape[1])
        moved, J_delta = exp_and_jacobian(J @ unknowns[columns])
        factors.append((moved, columns, J_delta @ J))
    factors.append((pose.rigid(np.eye(3), unknowns[TOOL]), TOOL, np.eye(6)[:, :3]))
    if gamma is not None:
        slipped, J_gamma = exp_and_jacobian(unknowns[gamma])
        factors.append((slipped, gamma, J_gamma))
    D = np.zeros((6, len(unknowns)))
    T = T_tip_part
    for factor, columns_of, twist in reversed(factors):
        if columns_of is not None:
            # a twist before T is the twist Ad(T^-1) of it behind T
            D[:, columns_of] = pose.adjoint(pose.inverse(T)) @ twist
        T = factor @ T
    return M @ T, D
