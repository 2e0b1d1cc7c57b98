"""Joint angles along a straight line of the tip: inverse kinematics at knots, and a cubic spline through them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from apo_bench.geometry import Array
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.robot.paths import Trajectory, smooth_trajectory, waypoints_around, waypoints_unwound

_KNOT_M = 0.03  # greatest spacing of knots along a line
_KNOT_RAD = 0.15  # greatest spacing of knots in the turn
_SHORT_M = 0.01  # a line up to this length has one inner knot, a longer one two at least
_SHORT_RAD = 0.05  # as `_SHORT_M`, for the turn
_SPEED_TIMES = 101
"""Number of times at which the joint speeds are checked."""
_CREEP_RAD_S = 2e-3
"""Joint speed above which dry friction is nearly full."""
_FAR_M = 0.3  # spacing of knots where only the end of a line counts
_FAR_RAD = 1.0  # as `_FAR_M`, for the turn


class Knots(NamedTuple):
    """Joint angles from inverse kinematics at places along a line."""

    s: Array
    """Fractions of the line, (k,), in equal steps."""
    q: Array
    """Joint angles there, (k, joints), [rad]."""

    def angles(self, t: Array) -> Array:
        """Return the joint angles of a cubic spline through the knots, (n, joints), [rad].

        Args:
            t: Fractions of the way from the first knot to the last, (n,), from 0 to 1.
        """
        return np.asarray(_basis(len(self.q))(t) @ self.q)


@lru_cache(maxsize=64)
def _basis(k: int) -> CubicSpline:
    """Return the splines through k equally spaced knots in [0, 1] of which one is 1 and the others are 0, (k,) values.

    A spline through any values at these knots is their sum with the values as weights.
    """
    return CubicSpline(np.linspace(0.0, 1.0, k), np.eye(k))


def along(kinematics: Kinematics, line: Trajectory, s: Array, q: Array, known: Knots | None = None) -> Array | None:
    """Return the joint angles at places along a line, (k, joints), or None if a place is out of reach.

    Args:
        s: Fractions of the line, (k,), in ascending order, from 0 to 1.
        q: Joint angles at the first of these places, (joints,), [rad].
        known: Knots from `limit_speed` of a line that begins at `q`, used if they are at the needed places.
    """
    if len(s) == 1:
        return np.asarray(q)[None]
    part = float(s[-1] - s[0])
    least = 3 if part * _steps(line, _SHORT_M, _SHORT_RAD) <= 1.0 else 4
    places = np.linspace(s[0], s[-1], max(least, int(np.ceil(part * _steps(line, _KNOT_M, _KNOT_RAD))) + 1))
    if known is None or not np.array_equal(known.s, places):
        known = _knots(kinematics, line, places, q)
    return None if known is None else known.angles((s - s[0]) / part)


def solve_end_angles(kinematics: Kinematics, line: Trajectory, begin: float, end: float, q: Array) -> Array | None:
    """Return the joint angles at one place of a line, (joints,), or None if it is out of reach.

    They are solved by way of a few knots, and if that fails by many.

    Args:
        begin, end: Fractions of the line, from 0 to 1.
        q: Joint angles at `begin`, (joints,), [rad].
    """
    for far, turn in ((_FAR_M, _FAR_RAD), (_KNOT_M, _KNOT_RAD)):  # few knots first, since they take less time
        knots = _knots(
            kinematics,
            line,
            np.linspace(begin, end, 1 + max(1, int(np.ceil((end - begin) * _steps(line, far, turn))))),
            q,
        )
        if knots is not None:
            return knots.q[-1]
    return None


def plan_waypoints(kinematics: Kinematics, arm: Arm, T: Array, end: Array, q: Array) -> tuple[Array, ...]:
    """Return the waypoints through the air from T, where the joint angles are q, to another pose, this included.

    The way is straight, unless only one around the base of the arm is in reach. The default arm (without `hand`) has
    room, and always takes the straight way.
    """
    rest = kinematics.forward(arm.home)
    straight = waypoints_unwound(rest, T, end)
    if arm.hand is None or follow_waypoints(kinematics, T, straight, q) is not None:
        return straight
    around = waypoints_around(np.array(arm.base), rest, T, end)
    return straight if follow_waypoints(kinematics, T, around, q) is None else around


def follow_waypoints(kinematics: Kinematics, T: Array, way: Sequence[Array], q: Array) -> Array | None:
    """Return the joint angles at the end of straight lines through waypoints, (joints,), None if out of reach.

    Args:
        T: Pose of the tip at the beginning, (4, 4).
        way: The waypoints, (4, 4) each.
        q: Joint angles at T, (joints,), [rad].
    """
    for to in way:
        path = along(kinematics, smooth_trajectory(T, to, 1.0), np.array([0.0, 1.0]), q)
        if path is None:
            return None
        T, q = to, path[-1]
    return q


def feedforward_command(path: Array, velocity: Array, lead: Array, stick: Array) -> Array:
    """Return the commands of position servos, (n, joints), with which the joints follow a path without lag.

    Args:
        path: Joint angles, (n, joints), [rad].
        velocity: Joint velocities, (n, joints), [rad/s].
        lead: Damping over gain of each servo, (joints,), [s].
        stick: Dry friction over gain of each servo, (joints,), [rad].
    """
    return np.asarray(path + (lead * velocity + stick * np.tanh(velocity / _CREEP_RAD_S)))


def limit_speed(
    kinematics: Kinematics, line: Trajectory, q: Array, limit: Array | None
) -> tuple[Trajectory, Knots | None]:
    """Slow a line down as a whole so that no joint exceeds its speed limit.

    Args:
        q: Joint angles at the beginning of the line, (joints,), [rad].
        limit: The speed limits, (joints,), [rad/s]; None: no limits.

    Returns:
        The line, and the knots that were solved for the check. Without limits, or out of reach, the line stays as it is
        and the knots are None.
    """
    if limit is None:
        return line, None
    knots = _knots(
        kinematics, line, np.linspace(0.0, 1.0, 1 + max(4, int(np.ceil(_steps(line, _KNOT_M, _KNOT_RAD))))), q
    )
    if knots is None:
        return line, None
    t = np.linspace(0.0, 1.0, _SPEED_TIMES)
    # dq/dt = dq/d(t/seconds) / seconds, so a line that takes `ratio` times as long keeps the limit.
    speed = np.abs(np.gradient(knots.angles(line.progress(t)), t, axis=0)) / line.seconds
    ratio = float((speed / limit).max())
    return (line if ratio <= 1.0 else replace(line, seconds=line.seconds * ratio)), knots


def _steps(line: Trajectory, far: float, turn: float) -> float:
    """Return how many steps a line takes if none is longer than `far`, [m], or turns more than `turn`, [rad]."""
    return max(line.length / far, math.hypot(*line.turn) / turn)


def _knots(kinematics: Kinematics, line: Trajectory, s: Array, q: Array) -> Knots | None:
    """Solve inverse kinematics at fractions s of a line, the first being at q; None if a place is out of reach.

    Each solution starts from the linear extrapolation of the two before, so that the arm keeps its configuration.
    """
    path = [np.asarray(q)]
    for i, T in enumerate(line.poses(s[1:])):
        reached = kinematics.inverse(T, 2 * path[-1] - path[-2] if i else path[-1])
        if reached is None:
            return None
        path.append(reached)
    return Knots(s, np.array(path))
