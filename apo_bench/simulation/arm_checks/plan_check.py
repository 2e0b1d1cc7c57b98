"""What an arm makes of a plan before it moves: reach, room to the limits of joints, room of the gripper, tip error."""

from collections.abc import Iterable
from typing import Any, Literal, NamedTuple, cast

import mujoco
import numpy as np

from apo_bench.assembly.goals import Plan, Poses
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, remembered
from apo_bench.geometry.intrusion import intrusion_depths
from apo_bench.geometry.solid import Solid
from apo_bench.prediction.arm import ArmMove
from apo_bench.simulation.arm_checks.tip_error import TipError, motion_error
from apo_bench.simulation.execution.fingers import OPEN_TO_PICK_M, OPEN_TO_RELEASE_M
from apo_bench.simulation.execution.prepare import Move, key_angles, moves
from apo_bench.simulation.execution.transfer import Grip
from apo_bench.simulation.robot.gripper import gripper_boxes
from apo_bench.simulation.scene.scene import Scene

_AT_LIMIT_RAD = np.radians(0.5)
_Refused = Literal["unreachable_start", "unreachable"]


class _Struck(NamedTuple):
    """The part that the gripper is deepest in, [m]."""

    depth: float = 0.0
    part: str = ""


def arm_moves(plan: Plan, scene: Scene, searches: bool = False) -> tuple[ArmMove, ...]:
    """Every transfer of a plan as the arm of a scene would do it.

    Of the usual arm, and of an `Arm` that was made without a description, only reach is looked at: what is foretold
    without an arm was found with that one.

    Args:
        searches: As in `moves`.
    """
    found = list[ArmMove]()
    believed = plan.start
    for move in moves(plan, scene, searches):
        made = _arm_move(plan, scene, move, believed)
        found.append(made)
        T = move.transfer.T_world_goal @ pose.inverse(believed[move.transfer.part])
        carried = plan.assembly.operations[move.step.operation].moves
        believed = {**believed, **{part: T @ believed[part] for part in carried}}
    return tuple(found)


def _arm_move(plan: Plan, scene: Scene, move: Move, believed: Poses) -> ArmMove:
    step = move.step
    t = move.transfer
    code, path, ended = key_angles(t, scene)
    if code:
        return ArmMove(step.operation, step.undo, cast(_Refused, code), _at_limit(scene, ended))
    if scene.arm.hand is None:
        return ArmMove(step.operation, step.undo)
    T = t.T_world_goal @ pose.inverse(believed[t.part])
    held = plan.assembly.operations[step.operation].moves
    after = {**believed, **{part: T @ believed[part] for part in held}}
    tip = scene.kinematics.forward(path[-1])[:3, 3]
    struck = max(
        _struck(scene, t.part, t.grips[0], OPEN_TO_PICK_M, believed),
        _struck(scene, t.part, t.grips[-1], OPEN_TO_RELEASE_M, after),
    )
    low, high = scene.kinematics.range_of_joints
    return ArmMove(
        operation=step.operation,
        undo=step.undo,
        struck=struck.part,
        struck_mm=1e3 * struck.depth,
        sag=_sag(scene, path[-1], _centroid(plan, move, after), t.weight_n),
        beside_mm=_beside_mm(scene, tip, [(plan.assembly.solids[part], after[part]) for part in held]),
        margin_deg=float(np.degrees(np.min([np.minimum(q - low, high - q) for q in path]))),
    )


def _at_limit(scene: Scene, q: Array) -> str:
    """The joint at its limit where the search for joint angles ended, at q, or nothing."""
    low, high = scene.kinematics.range_of_joints
    room = np.minimum(q - low, high - q)
    k = int(room.argmin())
    return scene.arm.joints[k] if room[k] < _AT_LIMIT_RAD else ""


def _struck(scene: Scene, part: str, grip: Grip, beyond: float, poses: Poses) -> _Struck:
    """What the open fingers are in where a part stands that they take, or have let go."""
    opening = min(grip.half_width + beyond, scene.arm.opening_m)
    boxes = gripper_boxes(scene.kinematics, scene.arm, opening)
    T = poses[part] @ grip.T_part_tip
    deepest = _Struck()
    for other, pieces in scene.pieces.items():
        if other != part:
            depth = float(intrusion_depths(boxes, T[:3, :3], T[None, :3, 3], pieces, poses[other])[0])
            deepest = max(deepest, _Struck(depth, other))
    return deepest


def _centroid(plan: Plan, move: Move, poses: Poses) -> Array:
    """Centre of mass of what is held, (3,), world, [m]; parts are homogeneous."""
    solids = [(part, plan.assembly.solids[part]) for part in plan.assembly.operations[move.step.operation].moves]
    at = np.array([pose.apply(poses[part], solid.centroid[None])[0] for part, solid in solids])
    volumes = np.array([solid.volume for _, solid in solids])
    return np.asarray(volumes @ at / volumes.sum())


def _sag(scene: Scene, q: Array, centroid: Array, weight_n: float) -> Array:
    """Where a weight takes the tip, and what it holds: servos give way by their torque over their stiffness."""
    kinematics = scene.kinematics
    model = scene.work.model
    tip = kinematics.forward(q)[:3, 3]
    J = _jacobian(kinematics.model, kinematics.configuration.data, kinematics.site, scene.arm.joints)
    stiffness = np.array([model.actuator(f"arm/{name}").gainprm[0] for name in scene.arm.joints])
    force = np.array([0.0, 0.0, -weight_n])
    wrench = np.concatenate([force, np.cross(centroid - tip, force)])
    twist = J @ ((J.T @ wrench) / stiffness)
    there = np.eye(4)
    back = np.eye(4)
    there[:3, 3] = tip
    back[:3, 3] = -tip
    return np.asarray(there @ pose.exp(twist) @ back)


def _jacobian(model: Any, data: Any, site: int, joints: tuple[str, ...]) -> Array:
    """Of the tip, (6, joints): how it moves [m] and turns [rad] with each joint [rad], world."""
    Jp = np.zeros((3, model.nv))
    Jr = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, Jp, Jr, site)
    return np.concatenate([Jp, Jr])[:, [int(model.joint(name).dofadr[0]) for name in joints]]


def _beside_mm(scene: Scene, tip: Array, parts: Iterable[tuple[Solid, Array]]) -> float:
    """How far what is held goes beside its line at the speed of an insertion: the tip, and its turn at their ends."""
    found = _tip_error(scene)
    if found is None:
        return 0.0
    corners = [pose.apply(T, corner) for solid, T in parts for corner in (np.array(solid.bounds),)]
    lever = max(float(np.linalg.norm(each - tip, axis=1).max()) for each in corners)
    return found.across_mm + 1e3 * np.radians(found.turn_deg) * lever


@remembered
def _tip_error(scene: Scene) -> TipError | None:
    """Found by trying; nothing where the tip has no way."""
    return motion_error(scene)
