"""Search for a hole where force stops an insertion.

Spirals follow under a light push at several yaws; then the part goes on, giving way across.

The robot knows what it commands and the force on the part in its hand; it never reads where a part is.
"""

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.search_laws import Easing, Spiral
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Guard, Robot, Trajectory, servo, smooth_trajectory, translate

RADIUS_M = 0.002
"""The robot searches for a hole so far off."""
YAWS_DEG = (1.0, -1.0, 2.0, -2.0)  # turns about the vertical at which shorter spirals follow
YAWED_RADIUS_M = 0.001  # how far these go
_BACK_M = 0.0005  # drawn back so far, a part touches nothing ahead
_BACK = 0.005  # peak speed [m/s] back
_BRING = 0.03  # peak speed [m/s] to where a spiral begins
_DEEP_M = 0.001
"""What goes so much deeper than where it was stopped has found the hole."""
SEARCHES = 3
"""A motion is searched for so many times at most, in one transfer up to twice as often."""
_PIECE_M = 0.01  # giving way, the tip goes on in pieces of this length
_NOTHING_M = 1e-6  # less than this is nothing


def press_in(
    robot: Robot, t: Transfer, grip: Grip, line: Trajectory, guard: Guard, near: float
) -> tuple[float, Array | None]:
    """A guarded motion of the tip that may search where it is stopped farther than `near` [m] from its end.

    Returns:
        What is left of it, [m], and what brings the poses that were meant to those that were found, (4, 4), world; None
        if nothing was searched for or found.
    """
    left = robot.follow(line, guard)
    if t.front is None:
        return left, None
    end = line.end
    T_search = None
    aside = 0.0
    T_tip_front = pose.inverse(grip.T_part_tip) @ pose.at(t.front)
    for _ in range(SEARCHES):
        if left <= near or aside >= RADIUS_M:
            break
        stopped = translate(end, guard.direction, float((robot.T - end)[:3, 3] @ guard.direction))
        macro = robot.macro
        robot.macro = "search"
        more = search_hole(robot, stopped, (stopped @ T_tip_front)[:3, 3], guard, t.slide_n, RADIUS_M - aside)
        robot.macro = macro
        if more is None:
            break
        guard = Guard(more[:3, :3] @ guard.direction, guard.newton)
        more = translate(more, _ease_in(robot, more @ end, guard), 1.0)
        T_search = more if T_search is None else more @ T_search
        end = more @ end
        left = float((end - robot.T)[:3, 3] @ guard.direction)
        aside = float(np.linalg.norm((end - line.end)[:3, 3]))
    return left, T_search


def after_search(T_search: Array | None, T: Array) -> Array:
    """A pose that was meant, as it has to be after a search."""
    return T if T_search is None else T_search @ T


def search_hole(robot: Robot, stopped: Array, front: Array, guard: Guard, press: float, radius: float) -> Array | None:
    """Look for the hole across a motion that was stopped; the tip is where it was stopped again if there is none.

    Args:
        stopped: The tip pose on the line that was meant, as deep as it came.
        front: The point about which the part is turned, (3,), world, [m].
        press: The push under which spirals go across, [N].
        radius: How far off the hole may be, [m].

    Returns:
        What brings the poses that were meant to those that were found, (4, 4), world; None if nothing was found.
    """
    off = translate(stopped, guard.direction, -_BACK_M)
    for yaw in (0.0, *YAWS_DEG):
        turn = _yaw_about(yaw, front)
        _approach(robot, turn @ off, guard.direction)
        turned = Guard(turn[:3, :3] @ guard.direction, guard.newton)
        far = min(radius, YAWED_RADIUS_M) if yaw else radius
        spiral = Spiral(turned, press, far, _BACK_M + _DEEP_M, robot.step_s)
        servo(robot, spiral)
        if spiral.found:
            return translate(turn, spiral.aside, 1.0)
    _approach(robot, off, guard.direction)
    robot.follow(smooth_trajectory(robot.T, stopped, _BACK), guard)
    return None


def _ease_in(robot: Robot, end: Array, guard: Guard) -> Array:
    """Go on as deep as a tip pose, giving way across; returns how far aside of it the tip ends, (3,), world, [m]."""
    while (left := float((end - robot.T)[:3, 3] @ guard.direction)) > _NOTHING_M:
        easing = Easing(guard, min(left, _PIECE_M), robot.step_s)
        servo(robot, easing)
        if easing.stopped:
            break
    off = (robot.T - end)[:3, 3]
    return np.asarray(off - (off @ guard.direction) * guard.direction)


def _approach(robot: Robot, T: Array, direction: Array) -> None:
    """Back first, so that nothing is touched on the way."""
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, direction, -_BACK_M), _BACK))
    robot.follow(smooth_trajectory(robot.T, T, _BRING))


def _yaw_about(yaw_deg: float, about: Array) -> Array:
    """The turn about the vertical through a point, (4, 4), world."""
    R = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw_deg))[:3, :3]
    return frame(R, about - R @ about)
