"""Where a robot with errors brings the parts of a plan: geometry, no physics.

The hand goes where the errors put it. Closing, its pads centre the part between them and lie flat on it, so what is
wrong along and about them when the part is taken is taken along, and what is wrong across them is not. What is let go
comes to rest on what carries it and against what it was slid to; where the hand closes on it once more, across, it is
centred there, too.
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from apo_bench.assembly import Plan, Poses
from apo_bench.geometry import Array, pose
from apo_bench.planning.prediction.resting import resting_poses
from apo_bench.simulation.execution import Grip, compute_transferred_poses, plan_moves, solve_key_angles
from apo_bench.simulation.execution.probing.config import PROBING_ACTIONS
from apo_bench.simulation.execution.probing.state import TOUCH_SIGMA_M
from apo_bench.simulation.robot import RobotError
from apo_bench.simulation.scene import Scene

_CENTRED = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0])
"""Of a twist in the frame of the tip, whose first axis the pads close along: what is left once they have closed."""
_PICK = 1
"""Of the key poses of a transfer; the last one is its goal."""
_UP = np.array([0.0, 0.0, 1.0])
_ERRORS = tuple(field.name for field in fields(RobotError))


def stack_errors(errors: Sequence[RobotError]) -> RobotError:
    """Several robots as one, for `brought`: each array has one more axis before the last ones of a pose, (r, ...)."""
    hand_eye, joints, tool, in_hand = (np.array([getattr(each, name) for each in errors]) for name in _ERRORS)
    return RobotError(hand_eye, joints, tool, in_hand.swapaxes(0, 1))


def brought(plan: Plan, scene: Scene, error: RobotError, spiral: bool = False) -> tuple[Poses, ...]:
    """Every part when a robot with these errors puts one, for each step of the schedule that does: the others rest.

    What is pushed in level floats on its way, as it is carried out.

    Args:
        error: Of one robot, or of several from `stack_errors`, which have poses (r, 4, 4) of what they moved.
        spiral: As in `plan_moves`.
    """
    resting = plan.start
    states = list[Poses]()
    for move in plan_moves(plan, scene, spiral):
        t = move.transfer
        k = move.step.operation
        operation = plan.assembly.operations[k]
        taken, let_go = [
            error.hand_eye @ _leant(scene, solve_key_angles(t, scene).reached[i], error) for i in (_PICK, -1)
        ]
        last = t.grips[-1].T_part_tip
        held = _held(t.grips[0], taken @ t.T_world_start @ t.grips[0].T_part_tip @ error.tool, resting[t.part])
        put = let_go @ t.T_world_goal @ last @ error.tool @ error.in_hand[k] @ held @ pose.inverse(last)
        now = compute_transferred_poses(operation, put, resting)
        if move.step.undo:
            resting = now
            continue
        floats = pose.at(t.floats * _UP) if t.into.level else np.eye(4)
        states.append(compute_transferred_poses(operation, floats @ put, resting))
        resting = resting_poses(plan.assembly, operation, now)
        for grip in t.centring:
            tip = let_go @ t.T_world_goal @ grip.T_part_tip @ error.tool
            centred = tip @ _held(grip, tip, resting[t.part]) @ pose.inverse(grip.T_part_tip)
            resting = resting_poses(plan.assembly, operation, compute_transferred_poses(operation, centred, resting))
    return tuple(states)


def left_after_feeling(plan: Plan, scene: Scene, error: RobotError, slip_deg: float) -> RobotError:
    """What is left of errors once a robot has felt: how parts slipped in its hand, but for what laying and search tell.

    Args:
        slip_deg: Standard deviation of how a part turns in the hand.
    """
    left = np.array(error.in_hand)
    for move in plan_moves(plan, scene, True, PROBING_ACTIONS):
        t = move.transfer
        slip = pose.log(left[move.step.operation])
        if t.flat is not None:
            felt = np.array([place.point for place in t.side_touches]) if t.side_touches else t.flat.feet
            lever = float(np.linalg.norm(felt - felt.mean(axis=0), axis=1).max())
            told = TOUCH_SIGMA_M / lever
            slip[2:4] *= 0.0, told / np.hypot(told, np.radians(slip_deg))
        if t.side_touches or t.front is not None:
            slip[1] = 0.0
        left[move.step.operation] = pose.exp(slip)
    none = np.eye(4)
    return RobotError(none, np.zeros_like(error.joints), none, left)


def _held(grip: Grip, tip: Array, T_part: Array) -> Array:
    """How a part that stands at T_part is off in the hand once its pads have closed at a tip, in its frame."""
    return np.asarray(pose.exp(_CENTRED * pose.log(pose.inverse(tip) @ T_part @ grip.T_part_tip)))


def _leant(scene: Scene, q: Array, error: RobotError) -> Array:
    """Where wrong zeros of the joints take the tip at joint angles q, a displacement of the world, (*, 4, 4)."""
    if not error.joints.any():
        return np.eye(4)
    right = pose.inverse(scene.kinematics.forward(q))
    wrong = [scene.kinematics.forward(q + each) for each in error.joints.reshape(-1, len(q))]
    return np.asarray(np.array(wrong).reshape(*error.joints.shape[:-1], 4, 4) @ right)
