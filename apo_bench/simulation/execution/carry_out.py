"""How one operation is carried out: `take` (pick, lift), then `bring` (carry, attach, release, depart).

Each is a sequence of straight motions of the tip, by `Robot.follow` and `Robot.go`, and of the fingers.
"""

from apo_bench.insertion.macros import UP
from apo_bench.simulation.execution.attach import ARRIVED_M, attach, leave, pull_out
from apo_bench.simulation.execution.fingers import centre, check_hold, depart, grasp, release
from apo_bench.simulation.execution.transfer import Grip, Transfer, first_contact_pose
from apo_bench.simulation.robot.paths import shifted, smooth, with_height
from apo_bench.simulation.robot.robot import Halt, Robot

_LIFT = (0.4, 0.25)
_CARRY = (0.5, 0.35)
_LOWER = (0.35, 0.2)
"""Peak speeds with a part, and with one that carries others, [m/s]: it drifts in the hand, the faster the more."""
_LOST_LOAD = 0.8
"""A hand that feels less than this part of the weight of a group has lost some of it."""


def take(robot: Robot, t: Transfer) -> int:
    """Pick the part and lift it; returns which of its grips is then in use.

    Raises:
        Halt: Something went wrong; the stage and code say what.
    """
    robot.stage = "pick"
    grasp(robot, t, t.grips[0], t.T_world_start @ t.grips[0].T_part_tip)
    in_use = 0
    if t.out.level:
        in_use = int(t.out.left is not None)
        pull_out(robot, t, t.grips[0], t.grips[1] if in_use else None)
    robot.stage = "lift"
    if t.carried:
        robot.follow(smooth(robot.T, shifted(robot.T, UP, 0.004), 0.02))
    leave(robot, t)
    robot.steady(not t.drawn)
    robot.follow(smooth(robot.T, with_height(robot.T, max(t.safe, robot.T[2, 3])), _LIFT[bool(t.carried)]))
    robot.steady(False)
    return in_use


def bring(robot: Robot, t: Transfer, i: int) -> None:
    """Carry the part that is held by its i-th grip, attach it, let go and depart.

    Raises:
        Halt: Something went wrong; the stage and code say what.
    """
    grip = t.grips[i]
    _carry(robot, t, grip)
    left, grip = attach(robot, t, grip, t.grips[i + 1] if t.into.left is not None else None)
    release(robot, t, grip)
    depart(robot, t)
    if left > ARRIVED_M:
        raise Halt("attach", "force_stop")
    for other in t.centring:
        centre(robot, t, other)


def _carry(robot: Robot, t: Transfer, grip: Grip) -> None:
    """Over everything that stands, down to where the last motion begins; there the arm stands, and feels its load."""
    robot.stage = "carry"
    before = shifted(first_contact_pose(t) @ grip.T_part_tip, t.into.way, -t.begins)
    if t.into.level:
        before = shifted(before, UP, t.floats)
    robot.steady(True)
    robot.go(with_height(before, max(t.safe, before[2, 3])), _CARRY[bool(t.carried)])
    robot.follow(smooth(robot.T, before, _LOWER[bool(t.carried)]))
    robot.steady(False)
    robot.stand()
    robot.hold_watch = robot.hold_watch.carry(robot.in_hand())
    check_hold(robot, grip)
    if t.carried and robot.scene.grasp == "friction" and robot.forces.load() < _LOST_LOAD * t.weight_n:
        raise Halt("carry", "lost_grasp", " or ".join(t.carried))
