"""Compute where a robot with errors places the parts of a plan, by geometry without physics.

The tip deviates by the errors of the robot. When the gripper closes, its pads centre the part between them and lie flat
on it. Errors along and about the pads remain in the hand, errors across them do not. A released part comes to rest on
its supports and sides. If the gripper then closes on it once more, across, the part is centred there, too.
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from apo_bench.assembly import Plan, Poses
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.rest_poses import predict_rest_poses
from apo_bench.simulation.execution import Grip, compute_transferred_poses, plan_moves, solve_key_angles
from apo_bench.simulation.execution.probing.state import TOUCH_SIGMA_M
from apo_bench.simulation.robot import RobotError
from apo_bench.simulation.scene import Scene

_CENTRED = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0])
"""Factors of a part's twist (v, w) in the tip frame after the pads close along x: x and turns about y, z vanish."""
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
        t = move.transfer
        k = move.step.operation
        operation = plan.assembly.operations[k]
        # Displacements of the tip at pick and at release, world frame.
        taken, let_go = [
            error.hand_eye @ _leant(scene, solve_key_angles(t, scene).reached[i], error) for i in (_PICK, -1)
        ]
        last = t.grips[-1].T_part_tip
        held = _held(t.grips[0], taken @ t.T_world_start @ t.grips[0].T_part_tip @ error.pads, resting[t.part])
        # part pose at release
        put = let_go @ t.T_world_goal @ last @ error.pads @ error.in_hand[k] @ held @ pose.inverse(last)
        now = compute_transferred_poses(operation, put, resting)
        if move.step.undo:
            resting = now
            continue
        floats = pose.at(t.floats * _UP) if t.into.level else np.eye(4)
        states.append(compute_transferred_poses(operation, floats @ put, resting))
        resting = predict_rest_poses(plan.assembly, operation, now)
        for grip in t.centring:
            tip = let_go @ t.T_world_goal @ grip.T_part_tip @ error.pads
            centred = tip @ _held(grip, tip, resting[t.part]) @ pose.inverse(grip.T_part_tip)
            resting = predict_rest_poses(
                plan.assembly, operation, compute_transferred_poses(operation, centred, resting)
            )
    return tuple(states)


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


def _held(grip: Grip, tip: Array, T_part: Array) -> Array:
    """Displacement of a part in the hand, tip frame, (*, 4, 4), once the pads have closed.

    Args:
        tip: World pose of the tip, (*, 4, 4).
        T_part: World pose of the part before the pads close, (*, 4, 4).
    """
    return np.asarray(pose.exp(_CENTRED * pose.log(pose.inverse(tip) @ T_part @ grip.T_part_tip)))


def _leant(scene: Scene, q: Array, error: RobotError) -> Array:
    """World displacement of the tip due to wrong joint zeros and sag at joint angles q, (*, 4, 4)."""
    if not (error.joints.any() or error.sag.any()):
        return np.eye(4)
    right = pose.inverse(scene.kinematics.forward(q))
    off = error.joints - error.sag * scene.kinematics.gravity_torque(q)
    wrong = [scene.kinematics.forward(q + each) for each in off.reshape(-1, len(q))]
    return np.asarray(np.array(wrong).reshape(*off.shape[:-1], 4, 4) @ right)
