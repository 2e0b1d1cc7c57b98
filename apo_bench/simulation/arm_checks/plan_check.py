"""What an arm makes of a plan before it moves: reach, room to the limits of joints, room of the gripper, tip error.

How far the tip of an arm is off its line at a speed, found by trying.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, cast, final

import mujoco
import numpy as np

from apo_bench.assembly import Plan, Poses
from apo_bench.geometry import Array, Solid, intrusion_depths, pose, remembered
from apo_bench.planning.prediction.measures import ArmMove
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import (
    OPEN_TO_PICK_M,
    OPEN_TO_RELEASE_M,
    Grip,
    Move,
    Transfer,
    after_transfer,
    holds_firmly,
    key_angles,
    moves,
)
from apo_bench.simulation.robot import Halt, Robot, Trajectory, gripper_boxes, shifted, smooth, steady
from apo_bench.simulation.scene import Scene

SPEEDS = (0.01, 0.06, 0.5)
"""[m/s], at which the robot touches, inserts, and carries."""
_HIGH_M = 0.35
"""Height at which errors are looked at, where the arm reaches it; else at that of its home."""
_AHEAD_M = 0.25
"""Farther ahead of its base than this: a line beside its axis turns it fast."""
WAY_M = 0.15
"""Length of the way along which they are looked at."""
STAND_S = 0.3
"""How long the arm stands before it."""
_RESTS_M = 2e-5
_LOOKS = 10
"""It stands so much longer, as often as this, until the tip is where it shall be: weak joints swing behind."""


@final
@dataclass(frozen=True, eq=False)
class TipError:
    """How far the tip is off where it should be at a speed."""

    speed: float
    """[m/s]"""
    across_mm: float
    """At most, beside the line."""
    along_mm: float
    turn_deg: float
    tilt_deg: float
    """How much of the turn the way ahead of the tip turns by; the rest is about that."""


@remembered
def motion_error(scene: Scene, speed: float = SPEEDS[1]) -> TipError | None:
    """The error of the tip of an empty hand in free air at a speed [m/s]; None where it has no way there.

    It is found by trying, once for a scene.
    """
    robot = Robot(scene, scene.scenario.start)
    try:
        with robot.watch_stability():
            rise(robot, SPEEDS[-1])
            way = WAY_M if speed > SPEEDS[0] else WAY_M / 10
            line = steady(robot.T, shifted(robot.T, np.array([0.0, 1.0, 0.0]), way), speed)
            return error_on(line, robot.trace(line), speed)
    except Halt:
        return None


def rise(robot: Robot, speed: float) -> None:
    """Go to where errors are looked at, at a speed [m/s], and come to rest there."""
    up = np.array(robot.T)
    up[0, 3] = max(up[0, 3], robot.arm.base[0] + _AHEAD_M)
    up[2, 3] = _HIGH_M
    if robot.scene.kinematics.inverse(up, robot.q) is None:
        up[2, 3] = robot.T[2, 3]
    if np.abs(up - robot.T).max() > 0.0:
        robot.trace(smooth(robot.T, up, speed))
    robot.wait(STAND_S)
    looks = 0
    while looks < _LOOKS and np.linalg.norm(robot.tip()[:3, 3] - robot.T[:3, 3]) > _RESTS_M:
        robot.wait(STAND_S)
        looks += 1


def error_on(line: Trajectory, tips: Array, speed: float) -> TipError:
    """Of where the tip was at each step, (n, 4, 4): beside the line, along it behind the command, and turned."""
    way = line.end[:3, 3] - line.start[:3, 3]
    way = way / np.linalg.norm(way)
    n = len(tips)
    commanded = line.poses(line.progress(np.arange(1, n + 1) / n))
    off = tips[:, :3, 3] - commanded[:, :3, 3]
    along = off @ way
    beside = np.linalg.norm(off - along[:, None] * way, axis=1)
    # The trace of R_commanded^T R is 1 + 2 cos(angle between them).
    turned = np.einsum("nij,nij->n", tips[:, :3, :3], commanded[:, :3, :3])
    angle = np.degrees(np.arccos(np.clip((turned - 1.0) / 2.0, -1.0, 1.0)))
    ahead = np.linalg.norm(np.cross(tips[:, :3, 2], commanded[:, :3, 2]), axis=1)
    tilt = float(np.degrees(np.arcsin(min(ahead.max(), 1.0))))
    return TipError(speed, 1e3 * float(beside.max()), 1e3 * float(np.abs(along).max()), float(angle.max()), tilt)


_AT_LIMIT_RAD = np.radians(0.5)
_Refused = Literal["unreachable_start", "unreachable"]


def arm_moves(plan: Plan, scene: Scene, spiral: bool = False) -> tuple[ArmMove, ...]:
    """Every transfer of a plan as the arm of a scene would do it.

    Of the usual arm, and of an `Arm` that was made without a description, only reach is looked at: predictions
    without an arm were tuned with that one.

    Args:
        searches: As in `moves`.
    """
    predicted = list[ArmMove]()
    believed = plan.start
    for move in moves(plan, scene, spiral):
        operation = plan.assembly.operations[move.step.operation]
        after = after_transfer(operation, move.transfer.T_world_goal, believed)
        held = [(plan.assembly.solids[part], after[part]) for part in operation.moves]
        predicted.append(_arm_move(scene, move, held, believed, after))
        believed = after
    return tuple(predicted)


def _arm_move(scene: Scene, move: Move, held: Sequence[tuple[Solid, Array]], believed: Poses, after: Poses) -> ArmMove:
    """One transfer.

    Args:
        held: What moves, each with its pose at the end.
        believed: Where all parts are before it.
        after: Where all parts are after it.
    """
    step = move.step
    t = move.transfer
    code, path, ended = key_angles(t, scene)
    if code:
        return ArmMove(step.operation, step.undo, cast(_Refused, code), _at_limit(scene, ended))
    if scene.arm.hand is None:
        return ArmMove(step.operation, step.undo)
    T_tip = scene.kinematics.forward(path[-1])
    depth, struck = struck_by(scene, t, believed, after)
    low, high = scene.kinematics.range_of_joints
    return ArmMove(
        operation=step.operation,
        undo=step.undo,
        struck=struck,
        struck_mm=1e3 * depth,
        sag=_sag(scene, path[-1], _centroid(held), t.weight_n),
        beside_mm=_beside_mm(scene, T_tip, held, not (t.into.level or holds_firmly(scene.arm))),
        margin_deg=float(np.degrees(np.min([np.minimum(q - low, high - q) for q in path]))),
    )


def _at_limit(scene: Scene, q: Array) -> str:
    """The joint at its limit where the search for joint angles ended, at q, or nothing."""
    low, high = scene.kinematics.range_of_joints
    room = np.minimum(q - low, high - q)
    k = int(room.argmin())
    return scene.arm.joints[k] if room[k] < _AT_LIMIT_RAD else ""


def struck_by(scene: Scene, t: Transfer, believed: Poses, after: Poses) -> tuple[float, str]:
    """How deep the open gripper is in a part, [m], and in which, where it takes hold or lets go."""
    return max(
        _struck(scene, t.part, t.grips[0], OPEN_TO_PICK_M, believed),
        _struck(scene, t.part, t.grips[-1], OPEN_TO_RELEASE_M, after),
    )


def _struck(scene: Scene, part: str, grip: Grip, beyond: float, poses: Poses) -> tuple[float, str]:
    """How deep the open fingers are in another part, [m], and in which, where a part stands that they take or have let
    go; zero and nothing where they have room."""
    boxes = gripper_boxes(scene.kinematics, scene.arm, min(grip.half_width + beyond, scene.arm.opening_m))
    T = poses[part] @ grip.T_part_tip
    depths = [
        (float(intrusion_depths(boxes, T[:3, :3], T[None, :3, 3], pieces, poses[other], 0.0)[0]), other)
        for other, pieces in scene.pieces.items()
        if other != part
    ]
    return max([(0.0, ""), *depths])


def _centroid(parts: Iterable[tuple[Solid, Array]]) -> Array:
    """Centre of mass of parts at poses, (3,), world, [m]; they are homogeneous."""
    at = np.array([pose.apply(T, solid.centroid[None])[0] for solid, T in parts])
    volumes = np.array([solid.volume for solid, _ in parts])
    return np.asarray(volumes @ at / volumes.sum())


def _sag(scene: Scene, q: Array, centroid: Array, weight_n: float) -> Array:
    """Where a weight takes the tip, and what it holds: servos give way by their torque over their stiffness."""
    tip = scene.kinematics.forward(q)[:3, 3]
    # Joint torques of a wrench at the tip are J^T w; each servo gives way by torque over stiffness, and J takes that to
    # a twist of the tip, which turns about the tip: there exp(twist) back.
    J = _jacobian(scene.kinematics)
    stiffness = np.array([scene.work.model.actuator(f"arm/{name}").gainprm[0] for name in scene.arm.joints])
    force = np.array([0.0, 0.0, -weight_n])
    wrench = np.concatenate([force, np.cross(centroid - tip, force)])
    twist = J @ ((J.T @ wrench) / stiffness)
    return np.asarray(pose.at(tip) @ pose.exp(twist) @ pose.at(-tip))


def _jacobian(kinematics: Kinematics) -> Array:
    """Of the tip, (6, joints): how it moves [m] and turns [rad] with each joint [rad], world, where the arm now is."""
    model = kinematics.model
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, kinematics.configuration.data, J[:3], J[3:], kinematics.site)
    return J[:, model.jnt_dofadr[kinematics.ids]]


def _beside_mm(scene: Scene, T_tip: Array, parts: Iterable[tuple[Solid, Array]], slowly: bool) -> float:
    """How far what is held goes beside its line where it enters: the tip, and its turn at their ends.

    Args:
        slowly: Whether it comes as slowly as where it touches; then the turn about the way ahead of the tip counts by
            how far aside of that the parts reach, which is nearly nothing for a peg.
    """
    error = motion_error(scene, SPEEDS[0 if slowly else 1])
    if error is None:
        return 0.0
    corners = [pose.apply(T, solid.bounds) - T_tip[:3, 3] for solid, T in parts]
    far, aside = (
        max(float(np.linalg.norm(each @ axes, axis=1).max()) for each in corners) for axes in (np.eye(3), T_tip[:3, :2])
    )
    tilt, turn = np.radians((error.tilt_deg, error.turn_deg))
    return error.across_mm + 1e3 * float(min(turn * far, tilt * far + turn * aside) if slowly else turn * far)
