"""Compute how an arm would execute a plan (`ArmMove`), for failure prediction."""

from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np

from apo_bench.assembly import Plan, Poses
from apo_bench.geometry import Array, Solid, measure_intrusion_depths, pose
from apo_bench.planning.prediction.arm_move import ArmMove, Refused
from apo_bench.simulation.arm_checks.tip_error import SPEEDS, motion_error
from apo_bench.simulation.execution import (
    OPEN_TO_PICK_M,
    OPEN_TO_RELEASE_M,
    Grip,
    Move,
    Transfer,
    compute_transferred_poses,
    plan_moves,
    solve_key_angles,
)
from apo_bench.simulation.robot import list_gripper_boxes
from apo_bench.simulation.scene import Scene

_AT_LIMIT_RAD = np.radians(0.5)  # a joint nearer to its limit counts as at the limit


def arm_moves(plan: Plan, scene: Scene, spiral: bool = False) -> tuple[ArmMove, ...]:
    """The motion of the scene's arm in every transfer of a plan.

    For the default arm, and for an `Arm` made without a description, only reach is computed, since predictions without
    an arm were tuned with the default one.

    Args:
        spiral: As in `plan_moves`.
    """
    predicted = list[ArmMove]()
    estimated = plan.start
    for move in plan_moves(plan, scene, spiral):
        operation = plan.assembly.operations[move.step.operation]
        after = compute_transferred_poses(operation, move.transfer.T_world_goal, estimated)
        held = [(plan.assembly.solids[part], after[part]) for part in operation.moves]
        predicted.append(_arm_move(scene, move, held, estimated, after))
        estimated = after
    return tuple(predicted)


def _arm_move(scene: Scene, move: Move, held: Sequence[tuple[Solid, Array]], estimated: Poses, after: Poses) -> ArmMove:
    """The motion of the arm in one transfer.

    Args:
        held: The moving solids, each with its pose at the end.
        estimated: The poses of all parts before the transfer.
        after: The poses of all parts after it.
    """
    step = move.step
    t = move.transfer
    code, path, ended = solve_key_angles(t, scene)
    if code:
        return ArmMove(step.operation, step.undo, cast(Refused, code), _at_limit(scene, ended))
    if scene.arm.hand is None:  # without a gripper file only reach is predicted
        return ArmMove(step.operation, step.undo)
    T_tip = scene.kinematics.forward(path[-1])  # at the goal
    depth, collides_with = find_gripper_overlap(scene, t, estimated, after)
    return ArmMove(
        operation=step.operation,
        undo=step.undo,
        collides_with=collides_with,
        collision_mm=1e3 * depth,
        sag=_sag(scene, path[-1], _centroid(held), t.weight_n),
        beside_mm=_beside_mm(scene, T_tip, held, not t.into.level),
        margin_deg=float(np.degrees(np.min(list(map(scene.kinematics.limit_margins, path))))),
    )


def _at_limit(scene: Scene, q: Array) -> str:
    """The joint at its limit at angles q, where the search for joint angles failed; empty if there is none."""
    room = scene.kinematics.limit_margins(q)
    k = int(room.argmin())
    return scene.arm.joints[k] if room[k] < _AT_LIMIT_RAD else ""


def find_gripper_overlap(scene: Scene, t: Transfer, estimated: Poses, after: Poses) -> tuple[float, str]:
    """The largest penetration of the open gripper into a part at grasp or release, [m], and that part."""
    return max(
        _deepest_overlap(scene, t.part, t.grips[0], OPEN_TO_PICK_M, estimated),
        _deepest_overlap(scene, t.part, t.grips[-1], OPEN_TO_RELEASE_M, after),
    )


def _deepest_overlap(scene: Scene, part: str, grip: Grip, beyond: float, poses: Poses) -> tuple[float, str]:
    """The largest penetration of the open fingers into a part other than the gripped one, [m], and that part.

    (0, "") if the fingers penetrate nothing.

    Args:
        beyond: Opening per finger beyond half the width of the gripped part, [m].
        poses: Poses of all parts at grasp or release.
    """
    boxes = list_gripper_boxes(scene.kinematics, min(grip.half_width + beyond, scene.arm.opening_m))
    T = poses[part] @ grip.T_part_tip
    depths = [
        (float(measure_intrusion_depths(boxes, T[:3, :3], T[None, :3, 3], pieces, poses[other], 0.0)[0]), other)
        for other, pieces in scene.pieces.items()
        if other != part
    ]
    return max([(0.0, ""), *depths])


def _centroid(parts: Iterable[tuple[Solid, Array]]) -> Array:
    """Centre of mass of homogeneous parts at poses, (3,), world frame, [m]."""
    at = np.array([pose.apply(T, solid.centroid[None])[0] for solid, T in parts])
    volumes = np.array([solid.volume for solid, _ in parts])
    return np.asarray(volumes @ at / volumes.sum())


def _sag(scene: Scene, q: Array, centroid: Array, weight_n: float) -> Array:
    """The world displacement of the tip and the held parts, (4, 4), by their weight at joint angles q."""
    T = scene.kinematics.forward(q)
    J = scene.kinematics.jacobian(q)
    # Joint torques of a wrench at the tip are J^T w; each servo yields by torque over stiffness, and J takes that to a
    # twist of the tip, in its own frame: T exp(twist) T^-1 in the world.
    stiffness = np.array([scene.work.model.actuator(f"arm/{name}").gainprm[0] for name in scene.arm.joints])
    force = np.array([0.0, 0.0, -weight_n])
    wrench = np.concatenate([force @ T[:3, :3], np.cross(centroid - T[:3, 3], force) @ T[:3, :3]])
    return np.asarray(T @ pose.exp(J @ ((J.T @ wrench) / stiffness)) @ pose.inverse(T))


def _beside_mm(scene: Scene, T_tip: Array, parts: Iterable[tuple[Solid, Array]], slowly: bool) -> float:
    """The largest deviation of the held parts from their line during an insertion: error and rotation of the tip, [mm].

    Args:
        slowly: The insertion is as slow as a guarded motion. Rotation about the axis ahead of the tip then counts by
            the extent of the parts across that axis, which is small for a peg.
    """
    error = motion_error(scene, SPEEDS[0 if slowly else 1])  # 0: touching, 1: inserting
    if error is None:
        return 0.0
    corners = [pose.apply(T, solid.bounds) - T_tip[:3, 3] for solid, T in parts]
    # Largest distance of a corner from the tip, and from the axis ahead of the tip.
    far, aside = (
        max(float(np.linalg.norm(each @ axes, axis=1).max()) for each in corners) for axes in (np.eye(3), T_tip[:3, :2])
    )
    tilt, turn = np.radians((error.tilt_deg, error.turn_deg))
    return error.across_mm + 1e3 * float(min(turn * far, tilt * far + turn * aside) if slowly else turn * far)
