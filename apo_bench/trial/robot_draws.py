"""Compute where a robot with errors places the parts of a plan, by geometry without physics.

The tip deviates by the errors of the robot. When the gripper closes, its pads centre the part between them and turn it
towards them, in part or until they lie flat on it. All other errors remain in the hand. A released part comes to rest
on its supports and sides. If the gripper then closes on it once more, across, the part is centred there, too.
"""

import math
from collections.abc import Sequence
from dataclasses import fields
from functools import partial

import numpy as np

from apo_bench.assembly import Plan, Poses
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.rest_poses import predict_rest_poses
from apo_bench.simulation.execution import (
    Move,
    Transfer,
    compute_transferred_poses,
    plan_moves,
    solve_key_angles,
)
from apo_bench.simulation.execution.probing.state import TOUCH_SIGMA_M
from apo_bench.simulation.robot import RobotError
from apo_bench.simulation.scene import Scene
from apo_bench.trial.trial_stages import robot_error_of

KEPT = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 0.8])
"""Share of a part's twist (v, w) in the tip frame that is left after the pads close along x; the last one is the mean
over generated assemblies (`python -m benchmarks.grasp_error`)."""
_FLAT = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0])
"""The same if pads lie flat on the part. The predicted success uses it: with `KEPT` it is 0.06 higher for robots with
errors, whose success it overestimates either way (Brier score 0.21 instead of 0.16 in the track `robot`)."""
_PICK = 1
"""Index of the pick pose among the key poses of a transfer; the last one is the goal."""
_UP = np.array([0.0, 0.0, 1.0])
_ERRORS = tuple(field.name for field in fields(RobotError))


def stack_errors(errors: Sequence[RobotError]) -> RobotError:
    """Stack the errors of r robots, so that `brought` computes the poses of all robots in one call.

    Every array gets a leading axis r, except `in_hand`, which becomes (operations, r, 4, 4).
    """
    stacked = {name: np.array([getattr(each, name) for each in errors]) for name in _ERRORS}
    return RobotError(**{**stacked, "in_hand": stacked["in_hand"].swapaxes(0, 1)})


def list_unit_errors(name: str, scene: Scene) -> list[RobotError]:
    """Robots each of which has one of the independent errors of a robot, as large as its standard deviation.

    Args:
        name: Standard deviations, as in `parse_robot_error`.
    """
    shapes: dict[int, tuple[int, ...]] = {}
    none = robot_error_of(name, scene, lambda stream, shape: np.zeros(shapes.setdefault(stream, shape)))
    numbers = [(stream, i) for stream, shape in shapes.items() for i in range(math.prod(shape))]
    errors = [robot_error_of(name, scene, partial(_unit, number)) for number in numbers]
    return [error for error in errors if _differ(error, none)]


def brought(plan: Plan, scene: Scene, error: RobotError, spiral: bool = False) -> tuple[Poses, ...]:
    """Poses of every part after each step of the schedule that places one; parts placed before are at rest.

    Undo steps have no entry. A part with a level insertion floats above its support, as in the execution.

    Args:
        error: Of one robot, or of r robots from `stack_errors`; then moved parts have poses (r, 4, 4).
        spiral: As in `plan_moves`.
    """
    resting = plan.start
    states = list[Poses]()
    for move in plan_moves(plan, scene, spiral):
        twist = _FLAT * twist_in_open_hand(scene, move.transfer, error, resting[move.transfer.part])
        put = bring(scene, move, error, twist)
        if not move.step.undo:
            floats = pose.at(move.transfer.floats * _UP) if move.transfer.into.level else np.eye(4)
            operation = plan.assembly.operations[move.step.operation]
            states.append(compute_transferred_poses(operation, floats @ put, resting))
        resting = place_part(plan, scene, move, error, put, resting, _FLAT)
    return tuple(states)


def bring(scene: Scene, move: Move, error: RobotError, twist: Array) -> Array:
    """Pose of the part of a move where the robot releases it, (*, 4, 4), world.

    Args:
        twist: Of the part in the frame of the tip once the pads have closed, (*, 6), [m, rad].
    """
    t = move.transfer
    last = t.grips[-1].T_part_tip @ error.pads
    released = _tip_displacement(scene, t, -1, error) @ t.T_world_goal @ last
    return np.asarray(released @ error.in_hand[move.step.operation] @ pose.exp(twist) @ pose.inverse(last))


def twist_in_open_hand(scene: Scene, t: Transfer, error: RobotError, T_part: Array) -> Array:
    """Twist of the part of a transfer in the frame of the tip before the pads close, (*, 6), [m, rad].

    Args:
        T_part: Pose of the part, (*, 4, 4), world.
    """
    grip = t.grips[0].T_part_tip @ error.pads
    tip = _tip_displacement(scene, t, _PICK, error) @ t.T_world_start @ grip
    return np.asarray(pose.log(pose.inverse(tip) @ T_part @ grip))


def place_part(
    plan: Plan, scene: Scene, move: Move, error: RobotError, put: Array, resting: Poses, kept: Array
) -> Poses:
    """Poses of all parts at rest after a move.

    Args:
        put: Where the robot releases the part, (*, 4, 4), world.
        resting: All poses before.
        kept: Share of a twist in the open hand that is left once the pads have closed, (6,).
    """
    t = move.transfer
    operation = plan.assembly.operations[move.step.operation]
    now = compute_transferred_poses(operation, put, resting)
    if move.step.undo:
        return now
    rest = predict_rest_poses(plan.assembly, operation, now)
    if not t.centring:
        return rest
    let_go = _tip_displacement(scene, t, -1, error) @ t.T_world_goal
    for each in t.centring:
        grip = each.T_part_tip @ error.pads
        tip = let_go @ grip
        held = pose.exp(kept * pose.log(pose.inverse(tip) @ rest[t.part] @ grip))
        now = compute_transferred_poses(operation, tip @ held @ pose.inverse(grip), rest)
        rest = predict_rest_poses(plan.assembly, operation, now)
    return rest


def left_after_feeling(plan: Plan, scene: Scene, error: RobotError, slip_deg: float) -> RobotError:
    """The errors that remain after probing: slips in the hand, without what laying down and searching correct.

    Args:
        slip_deg: Standard deviation of the rotation of a part in the hand.
    """
    left = np.array(error.in_hand)
    for move in plan_moves(plan, scene, True, True):
        t = move.transfer
        slip = pose.log(left[move.step.operation])
        if t.flat is not None:
            # touch points on the part
            felt = np.array([place.point for place in t.side_touches]) if t.side_touches else t.flat.feet
            lever = float(np.linalg.norm(felt - felt.mean(axis=0), axis=1).max())
            told = TOUCH_SIGMA_M / lever  # standard deviation of the rotation measured by touch [rad]
            # Twist index 2: z along the pads, corrected; index 3: rotation, reduced to what touches leave.
            slip[2:4] *= 0.0, told / np.hypot(told, np.radians(slip_deg))
        if t.side_touches or t.front is not None:
            slip[1] = 0.0  # y along the pads, found by touch
        left[move.step.operation] = pose.exp(slip)
    none = np.eye(4)
    return RobotError(none, np.zeros_like(error.joints), none, left)


def _tip_displacement(scene: Scene, t: Transfer, i: int, error: RobotError) -> Array:
    """World displacement of the tip by the errors of the robot at one of the key poses of a transfer, (*, 4, 4)."""
    if not (error.joints.any() or error.sag.any()):
        return error.hand_eye
    return np.asarray(error.hand_eye @ _leant(scene, solve_key_angles(t, scene).reached[i], error))


def _leant(scene: Scene, q: Array, error: RobotError) -> Array:
    """World displacement of the tip due to wrong joint zeros and sag at joint angles q, (*, 4, 4)."""
    right = pose.inverse(scene.kinematics.forward(q))
    off = error.joints - error.sag * scene.kinematics.gravity_torque(q)
    wrong = [scene.kinematics.forward(q + each) for each in off.reshape(-1, len(q))]
    return np.asarray(np.array(wrong).reshape(*off.shape[:-1], 4, 4) @ right)


def _unit(number: tuple[int, int], stream: int, shape: tuple[int, ...]) -> Array:
    """Zeros, but one for the number of a stream, counted from 0."""
    return np.asarray(np.arange(math.prod(shape)) == number[1], dtype=np.float64).reshape(shape) * (stream == number[0])


def _differ(a: RobotError, b: RobotError) -> bool:
    return any(not np.array_equal(getattr(a, name), getattr(b, name)) for name in _ERRORS)
