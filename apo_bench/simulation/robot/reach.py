"""Joint angles along a line: inverse kinematics at knots, a cubic spline through them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from apo_bench.geometry import Array
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.robot.paths import Trajectory, smooth_trajectory, waypoints_around, waypoints_unwound

_KNOT_M = 0.03  # inverse kinematics is solved at least this densely along a line
_KNOT_RAD = 0.15  # and along a turn
_SHORT_M = 0.01  # so short a line has one knot in its middle, any other two at least
_SHORT_RAD = 0.05  # as `_SHORT_M`, of a turn
_SPEED_TIMES = 101
"""Times at which the speed of the joints is checked."""
_CREEP_RAD_S = 2e-3
"""Dry friction is full above some such."""
_FAR_M = 0.3  # spacing of knots where only the end counts
_FAR_RAD = 1.0  # as `_FAR_M`, of a turn


class Knots(NamedTuple):
    """Joint angles that inverse kinematics found at places along a line."""

    s: Array
    """(k,), from 0 to 1."""
    q: Array
    """(k, joints), [rad]."""


def along(kinematics: Kinematics, line: Trajectory, s: Array, q: Array, known: Knots | None = None) -> Array | None:
    """Joint angles, (k, joints), at places along a line; None where the arm does not reach.

    Args:
        s: (k,), in ascending order, from 0 to 1.
        q: (joints,), at the first of the places, [rad].
        known: From `limit_speed`, of a line that begins at `q`; solved again only where other knots are needed.
    """
    if len(s) == 1:
        return np.asarray(q)[None]
    part = float(s[-1] - s[0])
    least = 3 if part * _steps(line, _SHORT_M, _SHORT_RAD) <= 1.0 else 4
    places = np.linspace(s[0], s[-1], max(least, int(np.ceil(part * _steps(line, _KNOT_M, _KNOT_RAD))) + 1))
    if known is None or not np.array_equal(known.s, places):
        known = _knots(kinematics, line, places, q)
    return None if known is None else np.asarray(CubicSpline(*known)(s))


def solve_end_angles(kinematics: Kinematics, line: Trajectory, begin: float, end: float, q: Array) -> Array | None:
    """Joint angles, (joints,), at `end`, found by way of a few places from `begin`, where they are q."""
    for far, turn in ((_FAR_M, _FAR_RAD), (_KNOT_M, _KNOT_RAD)):
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
    """Where to go through in the air from T, where the joints are q, to another pose.

    Straight, unless only a way around where the base stands is in reach, which short arms have in their way. The usual
    arm has room.
    """
    rest = kinematics.forward(arm.home)
    straight = waypoints_unwound(rest, T, end)
    if arm.hand is None or follow_waypoints(kinematics, T, straight, q) is not None:
        return straight
    around = waypoints_around(np.array(arm.base), rest, T, end)
    return straight if follow_waypoints(kinematics, T, around, q) is None else around


def follow_waypoints(kinematics: Kinematics, T: Array, way: Sequence[Array], q: Array) -> Array | None:
    """Where the joints end that lead the tip along straight lines from T, where they are q; None out of reach."""
    for to in way:
        path = along(kinematics, smooth_trajectory(T, to, 1.0), np.array([0.0, 1.0]), q)
        if path is None:
            return None
        T, q = to, path[-1]
    return q


def feedforward_command(path: Array, velocity: Array, lead: Array, stick: Array) -> Array:
    """The commands of position servos with which the joints are on a path, (n, joints), at velocities, [rad/s].

    Args:
        lead: (joints,), damping over gain, [s].
        stick: (joints,), dry friction over gain, [rad].
    """
    return np.asarray(path + (lead * velocity + stick * np.tanh(velocity / _CREEP_RAD_S)))


def limit_speed(
    kinematics: Kinematics, line: Trajectory, q: Array, limit: Array | None
) -> tuple[Trajectory, Knots | None]:
    """The same line, slower where a joint would turn faster than it can; and the knots that were solved for that.

    Args:
        q: (joints,), where the line begins, [rad].
        limit: (joints,), the speed limits, [rad/s]; None: there are none, and nothing is solved.
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
    speed = np.abs(np.gradient(CubicSpline(*knots)(line.progress(t)), t, axis=0)) / line.seconds
    ratio = float((speed / limit).max())
    return (line if ratio <= 1.0 else replace(line, seconds=line.seconds * ratio)), knots


def _steps(line: Trajectory, far: float, turn: float) -> float:
    """How many steps of these lengths, [m] and [rad], a line takes."""
    return max(line.length / far, float(np.linalg.norm(line.turn)) / turn)


def _knots(kinematics: Kinematics, line: Trajectory, s: Array, q: Array) -> Knots | None:
    """Each is looked for from where the two before it lead, so that the arm does not leap to another way to stand."""
    path = [np.asarray(q)]
    for i, T in enumerate(line.poses(s[1:])):
        reached = kinematics.inverse(T, 2 * path[-1] - path[-2] if i else path[-1])
        if reached is None:
            return None
        path.append(reached)
    return Knots(s, np.array(path))
