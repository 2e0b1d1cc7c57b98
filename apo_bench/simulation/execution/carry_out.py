"""Carry out one operation: `pick` (pick, lift), then `place` (carry, attach, release, depart).

Each is a sequence of straight motions of the tip, by `Robot.follow` and `Robot.go`, and of the fingers. The macros of
the plan become guarded motions where contacts close, and position-controlled ones along contacts that stay closed.
The file is long because the motions follow each other: it reads from top to bottom as the robot moves.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.fingers import centre, change_grip, check_hold, depart, grasp, grasp_again, release
from apo_bench.simulation.execution.search import after_search, press_in
from apo_bench.simulation.execution.transfer import ASIDE_M, Grip, Transfer, first_contact_pose
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Guard,
    Robot,
    Trajectory,
    move_to_height,
    plan_paced_trajectory,
    plan_steady_trajectory,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.robot.paths import distance
from apo_bench.simulation.scene import release_clamp, weld_clamp

_LIFT = (0.4, 0.25)  # peak speeds of lifting [m/s]: of a single part, and of one that carries others
_CARRY = (0.5, 0.35)  # as `_LIFT`, through the air
_LOWER = (0.35, 0.2)  # as `_LIFT`, down; the faster, the more a part drifts in the hand
_LOST_LOAD = 0.8
"""Measured load, as a fraction of the weight of a carried group, below which a part of the group is lost."""
_PLACE = 0.06  # speed [m/s] down to just above the support
_TOUCH = 0.01  # speed [m/s] where contact is expected
_INSERT = 0.06  # speed [m/s] near the entrance of a hole
_SLIDE = 0.005  # speed [m/s] of a slide towards a part at the side
_PULL = 0.1  # peak speed [m/s] at which a part is pulled out
_LEAVE = 0.03  # peak speed [m/s] at which a part is moved off a side
_OVERTRAVEL_M = 0.002
"""Distance beyond the goal up to which a motion seeks contact."""
_BOTTOM_M = 0.003
"""Distance before a bottom from which the robot approaches slowly."""
_ARRIVED_M = 0.001
"""An insertion that ends farther than this before its goal was stopped by force."""
_THROUGH = 0.15
"""Steady speed [m/s] between walls, away from entrances and bottoms."""
_BEFORE_M = 0.008  # the motion is slow from this far before an expected entrance
_BEHIND_M = 0.004  # and up to this far behind it
_BEYOND_M = 0.004  # greatest travel of a slide beyond the expected contact
_OFF_M = 0.0003  # height above the floor at which a part is slid
_LOOSE_M = 0.00005
"""Gap that stops friction between two faces, yet counts as contact for the judge."""


def pick(robot: Robot, t: Transfer, again: bool = False) -> int:
    """Pick the part and lift it to the carrying height.

    Returns:
        Index into `t.grips` of the grip that is then in use.

    Args:
        again: Whether the fingers open and close once more after the grasp, to square the part.

    Raises:
        ExecutionAborted: Something went wrong; stage and code name it.
    """
    release_clamp(robot.scene.work, robot.data, t.part)
    for other in t.squaring:
        robot.stage = "pick"
        centre(robot, t, other, t.T_world_start)
    robot.stage = "pick"
    grasp(robot, t, t.grips[0], t.T_world_start @ t.grips[0].T_part_tip)
    if again:
        grasp_again(robot, t.grips[0])
    in_use = _pull_out(robot, t) if t.out.level else 0
    robot.stage = "lift"
    if t.carried:  # slowly at first, so that carried parts do not shift
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, 0.004), 0.02))
    _leave(robot, t)
    robot.steady(not t.drawn)  # a part that is drawn out of walls touches them at first
    robot.follow(
        smooth_trajectory(robot.T, move_to_height(robot.T, max(t.safe, robot.T[2, 3])), _LIFT[bool(t.carried)])
    )
    robot.steady(False)
    return in_use


def place(robot: Robot, t: Transfer, i: int, lay: Callable[[Transfer, Grip], Grip] | None = None) -> None:
    """Carry the part, attach it, release it and depart.

    Args:
        i: Index into `t.grips` of the grip in use.
        lay: As for `carry_to_attach`.

    Raises:
        ExecutionAborted: Something went wrong; stage and code name it.
    """
    grip, second = carry_to_attach(robot, t, i, lay)
    # A slide sets its own name; the other macros are one motion.
    robot.macro = ", ".join(macro.name for macro in t.macros if macro.name != "slide-to-contact")
    left, grip = _attach(robot, t, grip, second)
    _leave_there(robot, t, grip, left)


def carry_to_attach(
    robot: Robot, t: Transfer, i: int, lay: Callable[[Transfer, Grip], Grip] | None
) -> tuple[Grip, Grip | None]:
    """Carry the part to where the guarded motion begins.

    Args:
        i: Index into `t.grips` of the grip in use.
        lay: Lays the part flat on a fixed face and returns its updated grip; None: this is skipped. Before a level
            insertion this happens after the carrying, else before it.

    Returns:
        The grip, and the next one if the grip changes during the insertion, else None.

    Raises:
        ExecutionAborted: Something went wrong; stage and code name it.
    """
    grip = t.grips[i]
    if lay is not None and not t.into.level:
        grip = lay(t, grip)
    _carry(robot, t, grip)
    if lay is not None and t.into.level:
        grip = lay(t, grip)
    robot.stage = "attach"
    return grip, t.grips[i + 1] if t.into.left is not None else None


def finish_attach(robot: Robot, t: Transfer, grip: Grip, second: Grip | None, T_found: Array) -> None:
    """Do the rest of an operation after an agent has moved the part to `find_attach_end`.

    Args:
        grip: The grip in use.
        second: The next grip, if the grip changes during the insertion.
        T_found: Transform from planned poses to those that the agent found, (4, 4), world.

    Raises:
        ExecutionAborted: Something went wrong; stage and code name it.
    """
    left = 0.0  # of the insertion, [m]
    rise = t.floats  # height of the part above its slot's floor, [m]
    if second is not None:
        grip, rise = _with_other_grip(robot, t, grip, second, T_found)
        left = _to_goal(robot, t, grip, rise, T_found)
    # After a level insertion down onto the floor of the slot, else on in the direction of the insertion.
    lower = rise if t.into.level else 0.0
    guard = Guard(-UP, t.place_n) if t.into.level else Guard(t.into.direction, t.place_n)
    if t.lands or not t.into.level:
        end = translate(robot.T, guard.direction, lower + _OVERTRAVEL_M)
        robot.follow(plan_steady_trajectory(robot.T, end, _TOUCH), guard)
    robot.stand()
    _slides(robot, t, left)
    _leave_there(robot, t, grip, left)


def find_attach_end(t: Transfer, grip: Grip, second: Grip | None) -> Array:
    """Return the tip pose at which the guarded motion ends, (4, 4); if the grip changes, the motion up to there."""
    goal = first_contact_pose(t)  # of the part
    if second is not None and t.into.left is not None:
        goal = translate(t.T_world_goal, t.into.direction, -t.into.left)
    return translate(goal, UP, t.floats if t.into.level else 0.0) @ grip.T_part_tip


class Pace(NamedTuple):
    """Speed limits of a guarded motion as a function of the distance to the goal."""

    quick: float
    """Speed outside of the stretches, [m/s]."""
    stretches: tuple[tuple[float, float, float], ...]
    """Slow stretches: begin and end as distances before the goal, [m], and greatest speed, [m/s]."""
    end: float
    """Distance before the goal at which the motion ends, [m]; negative where it seeks contact beyond the goal."""


def choose_pace(t: Transfer, second: Grip | None) -> Pace:
    """Return the speed limits of the motion to `find_attach_end`: slow near entrances and where contact may come.

    Args:
        second: The next grip, if the grip changes during the insertion.
    """
    if not t.into.level:
        return Pace(_PLACE, ((t.slow, -math.inf, _TOUCH),), -_OVERTRAVEL_M)
    entrances = tuple((at + _BEFORE_M, at - _BEHIND_M, _INSERT) for at in t.entrances)
    if second is not None and t.into.left is not None:
        return Pace(_THROUGH, entrances, t.into.left)
    if not t.presses:
        return Pace(_THROUGH, entrances, 0.0)
    return Pace(_THROUGH, (*entrances, (_BOTTOM_M, -math.inf, _TOUCH)), -_OVERTRAVEL_M)


def _leave_there(robot: Robot, t: Transfer, grip: Grip, left: float) -> None:
    """Release the part and depart; abort if the insertion was stopped more than `_ARRIVED_M` before its end.

    A part that is held by fasteners is clamped first, if the last motion ended on contact.

    Args:
        left: What is left of the insertion, [m].
    """
    if t.clamps_to and robot.felt and left <= _ARRIVED_M:
        weld_clamp(robot.scene.work, robot.data, t.part, t.clamps_to)
    release(robot, t, grip)
    depart(robot, t)
    if left > _ARRIVED_M:
        raise ExecutionAborted("attach", "force_stop")
    for other in t.centring:
        robot.stage = "release"
        centre(robot, t, other, t.T_world_goal)


def _carry(robot: Robot, t: Transfer, grip: Grip) -> None:
    """Carry the part over all others and down to where the last motion begins, and check there that it is still held.

    The load is weighed if the part carries others.
    """
    robot.stage = "carry"
    before = translate(first_contact_pose(t) @ grip.T_part_tip, t.into.direction, -t.begins)
    if t.into.level:
        before = translate(before, UP, t.floats)
    robot.steady(True)
    robot.go(move_to_height(before, max(t.safe, before[2, 3])), _CARRY[bool(t.carried)])
    robot.follow(smooth_trajectory(robot.T, before, _LOWER[bool(t.carried)]))
    robot.steady(False)
    robot.stand()
    robot.level()
    robot.slip_monitor = robot.slip_monitor.carry(robot.in_hand())
    check_hold(robot, grip)
    if t.carried and robot.scene.grasp == "friction" and robot.forces.load() < _LOST_LOAD * t.weight_n:
        raise ExecutionAborted("carry", "lost_grasp", " or ".join(t.carried))


def _attach(robot: Robot, t: Transfer, grip: Grip, second: Grip | None) -> tuple[float, Grip]:
    """Carry out the macros: those along `t.into` as one motion, then the slides.

    Returns:
        What is left of an insertion that force stopped, [m], and the grip in use.
    """
    left = 0.0
    if t.into.level:
        left, grip = _insert(robot, t, grip, second)
    else:
        _come_down(robot, t, grip)
    _slides(robot, t, left)
    return left, grip


def _slides(robot: Robot, t: Transfer, left: float) -> None:
    """Slide the part against each of its sides, unless the insertion was stopped early with `left` [m] to go."""
    for i, side in enumerate(t.sides if left <= _ARRIVED_M else ()):
        _slide(robot, t, side, t.sides[:i])


def _insert(robot: Robot, t: Transfer, grip: Grip, second: Grip | None) -> tuple[float, Grip]:
    """Insert the part along the guarded level line, changing the grip on the way if planned, and put it down.

    Returns:
        What is left of the line, [m], and the grip in use.
    """
    rise = t.floats
    T_search = None
    if t.into.left is not None and second is not None:
        line = _into(robot, t, find_attach_end(t, grip, second), t.into.left)
        left, T_search = press_in(robot, t, grip, line, Guard(t.into.direction, t.insert_n), _ARRIVED_M)
        if left > _ARRIVED_M:  # stopped by force before the change of grip
            return left + t.into.left, grip
        grip, rise = _with_other_grip(robot, t, grip, second, T_search)
    left = _to_goal(robot, t, grip, rise, T_search)
    if t.lands:
        lower = translate(robot.T, UP, -rise - _OVERTRAVEL_M)
        robot.follow(plan_steady_trajectory(robot.T, lower, _TOUCH), Guard(-UP, t.place_n))
    robot.stand()
    return left, grip


def _with_other_grip(robot: Robot, t: Transfer, grip: Grip, second: Grip, T_search: Array | None) -> tuple[Grip, float]:
    """Change to the second grip and lift the part off the floor of its slot.

    Args:
        T_search: From `press_in`: planned poses -> found ones, (4, 4), world; None without a search.

    Returns:
        The second grip, and the height of the part above the floor, [m].
    """
    # Pose of the part at the change of grip, still raised; the grasp itself is at the height of the floor.
    there = translate(translate(t.T_world_goal, t.into.direction, -(t.into.left or 0.0)), UP, t.floats)
    change_grip(robot, t, grip, second, after_search(T_search, translate(there, UP, -t.floats) @ second.T_part_tip))
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, t.clearance), 0.01))
    return second, t.clearance


def _to_goal(robot: Robot, t: Transfer, grip: Grip, rise: float, T_search: Array | None) -> float:
    """Move the part along the guarded level line to the goal, and against a bottom if the plan has one.

    Args:
        rise: Height of the part above the floor of its slot, [m].
        T_search: From `press_in`: planned poses -> found ones, (4, 4), world; None without a search.

    Returns:
        What is left of the line, [m].
    """
    guard = Guard(t.into.direction, t.insert_n)
    goal = after_search(T_search, translate(first_contact_pose(t) @ grip.T_part_tip, UP, rise))
    if not t.presses:
        return press_in(robot, t, grip, _into(robot, t, goal, 0.0), guard, _ARRIVED_M)[0]
    # Up to just before the bottom, then slowly until contact.
    line = _into(robot, t, translate(goal, t.into.direction, -_BOTTOM_M), _BOTTOM_M)
    left, T_search = press_in(robot, t, grip, line, guard, _ARRIVED_M)
    if left == 0.0:
        beyond = after_search(T_search, translate(goal, t.into.direction, _OVERTRAVEL_M))
        robot.follow(plan_steady_trajectory(robot.T, beyond, _TOUCH), guard)
    return left


def _come_down(robot: Robot, t: Transfer, grip: Grip) -> None:
    """Lower the part from above until it stands, slowly where contact may come."""
    down = Guard(t.into.direction, t.place_n)
    goal = first_contact_pose(t) @ grip.T_part_tip
    # Down to the slow stretch, then on until contact.
    above = plan_steady_trajectory(robot.T, translate(goal, t.into.direction, -t.slow), _PLACE)
    left, T_search = press_in(robot, t, grip, above, down, 0.0)
    if left == 0.0:
        end = after_search(T_search, translate(goal, t.into.direction, _OVERTRAVEL_M))
        press_in(robot, t, grip, plan_steady_trajectory(robot.T, end, _TOUCH), down, _OVERTRAVEL_M + t.stuck)
    robot.stand()


def _into(robot: Robot, t: Transfer, end: Array, left: float) -> Trajectory:
    """Return the trajectory to a tip pose, slow near the entrances.

    Args:
        end: The tip pose, (4, 4).
        left: Distance of the part from its goal when the tip is there, [m].
    """
    # Distances of the entrances from here.
    at = [distance(robot.T, end) + left - entrance for entrance in t.entrances]
    return plan_paced_trajectory(robot.T, end, _THROUGH, _INSERT, [(x - _BEFORE_M, x + _BEHIND_M) for x in at])


def _slide(robot: Robot, t: Transfer, side: Array, touched: tuple[Array, ...]) -> None:
    """Raise the part off the floor by `_OFF_M`, slide it sideways until it touches, and put it down again.

    A part that nothing carries, since it is clamped, is neither raised nor put down.

    Args:
        side: Direction of the slide, (3,), world.
        touched: Directions of earlier slides. The part first moves off these sides by `_LOOSE_M`, since the guard
            would take friction on them for the contact.
    """
    robot.macro = "slide-to-contact"
    if t.lands:
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, _OFF_M), 0.01))
    if touched:
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, np.sum(touched, axis=0), -_LOOSE_M), 0.01))
    robot.stand()
    robot.follow(
        plan_steady_trajectory(robot.T, translate(robot.T, side, ASIDE_M + _BEYOND_M), _SLIDE), Guard(side, t.slide_n)
    )
    if t.lands:
        down = translate(robot.T, UP, -_OFF_M - _OVERTRAVEL_M)
        robot.follow(plan_steady_trajectory(robot.T, down, _TOUCH), Guard(-UP, t.place_n))
    robot.stand()


def _pull_out(robot: Robot, t: Transfer) -> int:
    """Pull the part out backwards along `t.out`, changing the grip on the way if planned.

    Returns:
        Index into `t.grips` of the grip in use at the end.
    """
    robot.stage = "lift"
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, t.floats), 0.01))
    if t.out.left is None:
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, t.out.direction, -t.out.travel), _PULL))
        return 0
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, t.out.direction, -t.out.left), _PULL))
    part = translate(t.T_world_start, t.out.direction, -t.out.left)
    change_grip(robot, t, t.grips[0], t.grips[1], part @ t.grips[1].T_part_tip)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, t.floats), 0.01))
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, t.out.direction, t.out.left - t.out.travel), _PULL))
    return 1


def _leave(robot: Robot, t: Transfer) -> None:
    """Move the part off everything that it touches at its side, before it is lifted."""
    if t.away:
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, _OFF_M), 0.01))
    for side in t.away:
        robot.follow(smooth_trajectory(robot.T, translate(robot.T, side, ASIDE_M), _LEAVE))
