"""Where a robot with errors of its own would bring the parts of a plan: geometry, no physics.

The hand goes where the errors put it. Closing, its pads centre the part between them and lie flat on it, so what is
wrong along and about them when the part is taken is taken along, and what is wrong across them is not.
"""

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.prepare import Move, key_angles, moves
from apo_bench.simulation.execution.transfer import after_transfer
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.scene.scene import Scene

_CENTRED = np.array([0.0, 1.0, 1.0, 1.0, 0.0, 0.0])
"""Of a twist in the frame of the tip, whose first axis the pads close along: what is left once they have closed."""
_PICK = 1
"""Of the key poses of a transfer; the last one is its goal."""


def brought(plan: Plan, scene: Scene, error: RobotError, searches: bool = False) -> Plan:
    """The plan as it would end up: goals where a robot with these errors brings the parts.

    Args:
        searches: As in `moves`.
    """
    actual = plan.start
    goals = plan.goals.copy()
    for move in moves(plan, scene, searches):
        k = move.step.operation
        T = _put(move, scene, error, actual[move.transfer.part])
        actual = after_transfer(plan.assembly.operations[k], T, actual)
        if not move.step.undo:
            goals[k] = T
    return plan.with_goals(goals)


def _put(move: Move, scene: Scene, error: RobotError, T_part: Array) -> Array:
    """Where the part of a transfer ends up that stands at T_part, (4, 4), world."""
    t = move.transfer
    path = key_angles(t, scene).reached
    first = t.grips[0].T_part_tip
    last = t.grips[-1].T_part_tip
    taken = error.hand_eye @ _leant(scene, path[_PICK], error) @ t.T_world_start @ first @ error.tool
    let_go = error.hand_eye @ _leant(scene, path[-1], error) @ t.T_world_goal @ last @ error.tool
    # T_tip_part = exp(xi) T_tip_part as planned; pads that close set xi to zero across them
    xi = pose.log(pose.inverse(taken) @ T_part @ first)
    held = error.in_hand[move.step.operation] @ pose.exp(_CENTRED * xi)
    return np.asarray(let_go @ held @ pose.inverse(last))


def _leant(scene: Scene, q: Array, error: RobotError) -> Array:
    """Where wrong zeros of the joints take the tip at joint angles q, a displacement of the world, (4, 4)."""
    if not error.joints.any():
        return np.eye(4)
    right = scene.kinematics.forward(q)
    return np.asarray(scene.kinematics.forward(q + error.joints) @ pose.inverse(right))
