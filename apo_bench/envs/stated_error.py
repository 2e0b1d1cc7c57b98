"""The stated error of a held part relative to its hole, which the same robot built: hand-eye errors partly cancel.

Errors are small, so they add as twists along world axes, zeta: a part stands at exp(zeta) T instead of T. Each is a
linear map of the errors of the robot, of unit variance. A hand closes on a part and centres it between its pads: the
shift along their normal and the two turns that the pads prevent are then those of the hand. The others stay as they
were when the hand closed. A part that is put down comes to lie flat on its support. What is left between the held part
and those that it goes into is the error that matters.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Observation, Plan, Poses, compute_joint_covariance, compute_placements
from apo_bench.assembly.equations import build_contact_equations
from apo_bench.geometry import Array, pose
from apo_bench.records.robot_error import Sigmas
from apo_bench.simulation.execution import Grip, Move, Transfer
from apo_bench.simulation.robot import translate
from apo_bench.simulation.scene import Scene

_FREE = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Share of the error of a round part in the hand, in the frame of the tip, that closing pads leave as it is."""
_FREE_FLAT = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.2])
"""The same of a part with flat sides, which the pads turn."""
_FRICTION = np.array([*np.full(3, 4e-5), *np.radians([0.02, 0.05, 0.07])])
"""What a grasp adds by friction, (6,), 1 sigma, [m, rad]."""
_LYING = np.array([*np.full(3, 4e-5), *np.radians([0.02, 0.05, 0.3])])
"""The same of a round part that lies, which pads turn when they close off its middle."""
_DOWN = 0.7
"""A face with a normal this far down lies on its support."""
_STEP = 1e-6
"""Step of the derivatives of placements by operations, [m, rad]."""


@final
class RobotErrors(NamedTuple):
    """The errors of a robot that its controller does not know, as columns of unit variance."""

    scene: Scene
    sigmas: Sigmas
    operations: int

    @property
    def size(self) -> int:
        """Number of columns: hand-eye, tilt of the base, tool, finger, joints, and in each hold slip and friction."""
        return 12 + len(self.scene.arm.joints) + 9 * self.operations

    def of_tip(self, T: Array) -> Array:
        """Return the error of the real tip, (6, size), where the robot estimates it at T, (4, 4)."""
        of = self.sigmas
        m, rad = 1e-3, math.pi / 180.0
        middle = np.eye(4)
        middle[:3, 3] = self.scene.scenario.nominal_poses[:, :3, 3].mean(axis=0)
        foot = pose.at(self.scene.arm.base)
        there = pose.adjoint(T)
        columns = [
            pose.adjoint(middle) * np.repeat([m * of.hand_eye[0], rad * of.hand_eye[1]], 3),
            pose.adjoint(foot)[:, 3:5] * rad * of.base_tilt_deg,
            there[:, :3] * m * of.tool_mm,
            there[:, :1] * m * of.finger_mm / 2,
            there @ self._joint_columns(T) * rad * of.joints_deg,
            np.zeros((6, 9 * self.operations)),
        ]
        return np.hstack(columns)

    def of_hold(self, operation: int, friction: Array) -> Array:
        """Return the slip of the part of an operation in the hand, (6, size), in the frame of the tip.

        Args:
            friction: What the grasp adds, (6,), 1 sigma.
        """
        of = self.sigmas
        columns = np.zeros((6, self.size))
        first = self.size - 9 * (self.operations - operation)
        slips = np.array([1e-3 * of.in_hand[0], 1e-3 * of.in_hand[0], math.radians(of.in_hand[1])])
        columns[1:4, first : first + 3] = np.diag(slips)  # along both axes of the pads, and about their normal
        columns[:, first + 3 : first + 9] = np.diag(friction)
        return columns

    def _joint_columns(self, T: Array) -> Array:
        """Return the body Jacobian of the tip at T, (6, joints); zero without joint errors or out of reach."""
        kinematics = self.scene.kinematics
        q = kinematics.inverse(T, self.scene.arm.home) if self.sigmas.joints_deg else None
        return np.zeros((6, len(self.scene.arm.joints))) if q is None else kinematics.jacobian(q)


def state_relative_error(
    errors: RobotErrors, plan: Plan, moves: Sequence[Move], k: int, grip: Grip, joint: Array
) -> Array:
    """Return the covariance of the error of the held part relative to its hole, (6, 6), [m, rad], world axes.

    It is that where the guarded motion begins: of the shift of the front of the part, and of its rotation.

    Args:
        errors: Those that the robot assumes.
        moves: The moves of the plan.
        k: The operation, counted from 0.
        grip: The grip with which its part is held.
        joint: Covariance of the body twists of all planned poses, (6 n, 6 n), [m, rad].
    """
    assembly = plan.assembly
    contacts = assembly.operations[k].contacts
    pairs = sorted({(contact.manipulated.part, contact.environment.part) for contact in contacts})
    last = max(i for i, move in enumerate(moves) if move.step.operation == k and not move.step.undo)
    placed = _place_parts(errors, assembly, moves[:last], plan.start)
    t = moves[last].transfer
    t = replace(t, T_world_goal=translate(t.T_world_goal, t.into.direction, -t.begins))
    held = _hold(errors, assembly, t, k, grip, placed)
    moved = _carry(t, held, placed)
    planned = _differentiate_placements(plan, k)
    B = np.mean([moved[part] - placed[other] for part, other in pairs], axis=0)
    A = np.mean([planned[part] - planned[other] for part, other in pairs], axis=0)
    C = B @ B.T + A @ joint @ A.T
    front = pose.apply(t.T_world_goal, t.foremost[None])[0]
    to_front = np.block([[np.eye(3), -pose.hat(front)], [np.zeros((3, 3)), np.eye(3)]])
    return np.asarray(to_front @ C @ to_front.T)


def correlate_plan(observation: Observation, poses: Array, exact: bool) -> Array:
    """Return the covariance of the body twists of all planned poses, (6 n, 6 n), [m, rad].

    Args:
        observation: The observation that was corrected.
        poses: The planned poses, (n, 4, 4).
        exact: Whether the poses fulfil the contact equations, which then hold in their errors too.
    """
    C = compute_joint_covariance(observation.poses, observation.covariance, observation.shared)
    if not exact:
        return C
    J = build_contact_equations(observation.assembly, observation.start, poses).linearise(poses)[1]
    CJ = C @ J.T
    return np.asarray(C - CJ @ np.linalg.pinv(J @ CJ, rcond=1e-9, hermitian=True) @ CJ.T)


def _place_parts(errors: RobotErrors, assembly: Assembly, moves: Sequence[Move], start: Poses) -> dict[str, Array]:
    """Return the error of each part after some moves, (6, size) each; none where it was not moved."""
    placed: dict[str, Array] = {part: np.zeros((6, errors.size)) for part in start}
    for step, t in moves:
        moved = _carry(t, _hold(errors, assembly, t, step.operation, t.grips[0], placed), placed)
        for other in (*t.grips[1:], *t.centring):
            moved[t.part] = _centre(errors, t.T_world_goal @ other.T_part_tip, moved[t.part])
        placed.update(moved)
        if not step.undo:
            contacts = assembly.operations[step.operation].contacts
            placed[t.part] = _lay_down(assembly, contacts, t, placed)
    return placed


def _hold(
    errors: RobotErrors, assembly: Assembly, t: Transfer, operation: int, grip: Grip, placed: Mapping[str, Array]
) -> Array:
    """Return the error of a part that the hand brings to its goal, (6, size)."""
    T_start = t.T_world_start @ grip.T_part_tip
    T_goal = t.T_world_goal @ grip.T_part_tip
    in_hand = pose.adjoint(pose.inverse(T_start)) @ (placed[t.part] - errors.of_tip(T_start))
    shafts = [face for face in assembly.solids[t.part].rounds.values() if not face.hole]
    lies = any(abs((T_start[:3, :3].T @ t.T_world_start[:3, :3] @ face.axis)[2]) < _DOWN for face in shafts)
    free = _FREE if shafts else _FREE_FLAT
    in_hand = free[:, None] * in_hand + errors.of_hold(operation, _LYING if lies else _FRICTION)
    return np.asarray(errors.of_tip(T_goal) + pose.adjoint(T_goal) @ in_hand)


def _centre(errors: RobotErrors, T_tip: Array, part: Array) -> Array:
    """Return the error of a standing part after the hand closed on it, (6, size)."""
    tip = errors.of_tip(T_tip)
    in_hand = _FREE_FLAT[:, None] * (pose.adjoint(pose.inverse(T_tip)) @ (part - tip))
    return np.asarray(tip + pose.adjoint(T_tip) @ in_hand)


def _carry(t: Transfer, main: Array, placed: Mapping[str, Array]) -> dict[str, Array]:
    """Return the errors of all parts that move with the main one, (6, size) each."""
    way = pose.adjoint(t.T_world_goal @ pose.inverse(t.T_world_start))
    return {part: main + way @ (placed[part] - placed[t.part]) for part in (t.part, *t.carried)}


def _lay_down(assembly: Assembly, contacts: Sequence[Contact], t: Transfer, placed: Mapping[str, Array]) -> Array:
    """Return the error of a part that came to lie flat on its support, (6, size)."""
    error = placed[t.part]
    for contact in contacts:
        if contact.manipulated.part != t.part or assembly.is_round(contact):
            continue
        face = assembly.face(contact.manipulated)
        n = t.T_world_goal[:3, :3] @ face.normal
        if n[2] > -_DOWN:
            continue
        corners = pose.apply(t.T_world_goal, face.outline) - t.T_world_goal[:3, 3]
        about = np.block([[np.eye(3), -pose.hat(t.T_world_goal[:3, 3])], [np.zeros((3, 3)), np.eye(3)]])
        J = np.hstack([np.tile(n, (len(corners), 1)), np.cross(corners, n)])  # of twists about the origin of the part
        kept = np.linalg.inv(about) @ np.linalg.pinv(J) @ J @ about
        return np.asarray(error - kept @ (error - placed[contact.environment.part]))
    return error


def _differentiate_placements(plan: Plan, k: int) -> dict[str, Array]:
    """Return the derivative of the error of each part after operation k by the body twists of all poses, (6, 6 n)."""
    usual = compute_placements(plan.assembly, plan.start, plan.target_poses)[k]
    found: dict[str, Array] = {part: np.zeros((6, 6 * len(plan.target_poses))) for part in usual}
    for i in range(k + 1):
        for j, twist in enumerate(_STEP * np.eye(6)):
            poses = np.array(plan.target_poses)
            poses[i] = poses[i] @ pose.exp(twist)
            for part, T in compute_placements(plan.assembly, plan.start, poses)[k].items():
                found[part][:, 6 * i + j] = pose.log(T @ pose.inverse(usual[part])) / _STEP
    return found
