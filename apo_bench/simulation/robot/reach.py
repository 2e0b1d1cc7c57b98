"""Joint angles along a line: inverse kinematics at knots, a cubic spline through them."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from apo_bench.geometry.arrays import Array
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.robot.paths import Trajectory

_KNOT_M = 0.03
_KNOT_RAD = 0.15
"""Inverse kinematics is solved at least this densely along a line."""
_SHORT_M = 0.01
_SHORT_RAD = 0.05
"""So short a line has one knot in its middle; any other has two at least."""
_SPEED_LOOKS = 101
"""Times at which the speed of joints is looked at."""
_FAR_M = 0.3
_FAR_RAD = 1.0
"""The spacing of knots where only the joint angles at the end are asked for."""


def along(kinematics: Kinematics, line: Trajectory, s: Array, q: Array) -> Array | None:
    """Joint angles, (k, joints), at places along a line; None where the arm does not reach.

    Args:
        s: (k,), in ascending order, from 0 to 1.
        q: (joints,), at the first of the places, [rad].
    """
    if len(s) == 1:
        return np.asarray(q)[None]
    part = float(s[-1] - s[0])
    least = 3 if part * _steps(line, _SHORT_M, _SHORT_RAD) <= 1.0 else 4
    count = max(least, int(np.ceil(part * _steps(line, _KNOT_M, _KNOT_RAD))) + 1)
    at = np.linspace(s[0], s[-1], count)
    found = _angles(kinematics, line, at, q)
    return None if found is None else np.asarray(CubicSpline(at, found)(s))


def at_end(kinematics: Kinematics, line: Trajectory, begin: float, end: float, q: Array) -> Array | None:
    """Joint angles, (joints,), at `end`, found by way of a few places from `begin`, where they are q."""
    count = 1 + max(1, int(np.ceil((end - begin) * _steps(line, _FAR_M, _FAR_RAD))))
    found = _angles(kinematics, line, np.linspace(begin, end, count), q)
    return None if found is None else np.asarray(found[-1])


def within_speed(kinematics: Kinematics, line: Trajectory, q: Array, most: Array | None) -> Trajectory:
    """The same line, slower where a joint would turn faster than it can.

    Args:
        q: (joints,), where the line begins, [rad].
        most: (joints,), the speed limits, [rad/s]; None: there are none.
    """
    if most is None:
        return line
    count = 1 + max(4, int(np.ceil(_steps(line, _KNOT_M, _KNOT_RAD))))
    at = np.linspace(0.0, 1.0, count)
    path = _angles(kinematics, line, at, q)
    if path is None:
        return line
    t = np.linspace(0.0, 1.0, _SPEED_LOOKS)
    s = line.progress(t)
    speed = np.abs(np.gradient(CubicSpline(at, path)(s), t, axis=0)) / line.seconds
    ratio = float((speed / most).max())
    return line if ratio <= 1.0 else replace(line, seconds=line.seconds * ratio)


def _steps(line: Trajectory, far: float, turn: float) -> float:
    """How many steps of these lengths, [m] and [rad], a line takes."""
    return max(
        float(np.linalg.norm(line.end[:3, 3] - line.start[:3, 3])) / far, float(np.linalg.norm(line.turn)) / turn
    )


def _angles(kinematics: Kinematics, line: Trajectory, s: Array, q: Array) -> Array | None:
    path = [np.asarray(q)]
    for i, T in enumerate(line.poses(s[1:])):
        found = kinematics.inverse(T, 2 * path[-1] - path[-2] if i else path[-1])
        if found is None:
            return None
        path.append(found)
    return np.array(path)
