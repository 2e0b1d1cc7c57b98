"""Search for a hole along spirals when force stops an insertion, then continue the insertion compliantly.

The spirals run under a light push at several yaw angles. The robot uses its commands and the force on the held part; it
never reads the true pose of a part.
"""

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.search_laws import Easing, Spiral
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Guard, Robot, Trajectory, servo, smooth_trajectory, translate

RADIUS_M = 0.002
"""Greatest offset of the hole that the search covers."""
YAWS_DEG = (1.0, -1.0, 2.0, -2.0)  # yaw angles of the further, shorter spirals
YAWED_RADIUS_M = 0.001  # radius of these spirals
_BACK_M = 0.0005  # distance back after which a part touches nothing ahead
_BACK = 0.005  # peak speed [m/s] back
_BRING = 0.03  # peak speed [m/s] to the begin of a spiral
_DEEP_M = 0.001
"""Depth beyond the stop from which the hole counts as found."""
SEARCHES = 3
"""Greatest number of searches in one motion; a transfer has up to two such motions."""
_PIECE_M = 0.01  # length of the pieces in which the compliant insertion proceeds
_NOTHING_M = 1e-6  # a shorter remaining distance counts as none


def press_in(
    robot: Robot, t: Transfer, grip: Grip, line: Trajectory, guard: Guard, near: float
) -> tuple[float, Array | None]:
    """Follow a line with a guard, and search for the hole if the motion stops too early.

    Args:
        line: From the present tip pose.
        guard: Force limit in the direction of the motion.
        near: Distance from the end of the line, [m]; a stop farther away starts a search.

    Returns:
        What is left of the line, [m], and the transform from planned poses to found ones, (4, 4), world. The transform
        is None without a search, or if the search found nothing.
    """
    left = robot.follow(line, guard)
    if t.front is None:  # this transfer does not search
        return left, None
    end = line.end
    T_search = None
    aside = 0.0  # offset of the searches so far, [m]
    # The part's foremost point in the frame of the tip.
    T_tip_front = pose.inverse(grip.T_part_tip) @ pose.at(t.front)
    for _ in range(SEARCHES):
        if left <= near or aside >= RADIUS_M:
            break
        # The point of the line at the depth of the tip.
        stopped = translate(end, guard.direction, float((robot.T - end)[:3, 3] @ guard.direction))
        macro = robot.macro
        robot.macro = "search"
        more = search_hole(robot, stopped, (stopped @ T_tip_front)[:3, 3], guard, t.slide_n, RADIUS_M - aside)
        robot.macro = macro
        if more is None:
            break
        guard = Guard(more[:3, :3] @ guard.direction, guard.newton)
        # Continue the insertion there, and include the lateral offset with which it ends.
        more = translate(more, _ease_in(robot, more @ end, guard), 1.0)
        T_search = more if T_search is None else more @ T_search
        end = more @ end
        left = float((end - robot.T)[:3, 3] @ guard.direction)
        aside = float(np.linalg.norm((end - line.end)[:3, 3]))
    return left, T_search


def after_search(T_search: Array | None, T: Array) -> Array:
    """Return a planned pose moved by the transform of `press_in`; unchanged if this is None."""
    return T if T_search is None else T_search @ T


def search_hole(robot: Robot, stopped: Array, front: Array, guard: Guard, press: float, radius: float) -> Array | None:
    """Search for the hole by spirals across a motion that was stopped; without success return to `stopped`.

    Args:
        stopped: The tip pose on the planned line at the depth of the stop, (4, 4).
        front: The point about which the part is yawed, (3,), world, [m].
        guard: Direction and force limit of the stopped motion.
        press: The push along this direction during a spiral, [N].
        radius: Greatest offset of the hole, [m].

    Returns:
        The transform from planned poses to found ones, (4, 4), world; None if nothing was found.
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
    """Continue to the depth of a tip pose, compliant to lateral forces.

    Args:
        end: The tip pose, (4, 4).

    Returns:
        Lateral offset of the tip from this pose at the end, (3,), world, [m].
    """
    while (left := float((end - robot.T)[:3, 3] @ guard.direction)) > _NOTHING_M:
        easing = Easing(guard, min(left, _PIECE_M), robot.step_s)
        servo(robot, easing)
        if easing.stopped:
            break
    off = (robot.T - end)[:3, 3]
    return np.asarray(off - (off @ guard.direction) * guard.direction)


def _approach(robot: Robot, T: Array, direction: Array) -> None:
    """Move back along the direction, so that nothing is touched on the way, then to a tip pose T."""
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, direction, -_BACK_M), _BACK))
    robot.follow(smooth_trajectory(robot.T, T, _BRING))


def _yaw_about(yaw_deg: float, about: Array) -> Array:
    """Return the rotation about the vertical through a point, (3,), as a transform, (4, 4), world."""
    R = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw_deg))[:3, :3]
    return frame(R, about - R @ about)
