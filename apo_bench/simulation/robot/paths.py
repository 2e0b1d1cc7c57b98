"""Straight-line trajectories of the tip, with smooth, steady and paced timing, and waypoints for the wrist."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.frames import rotation_vector

_PEAK = 1.875
"""Peak over mean speed of a minimum-jerk motion."""
_SHORTEST_S = 0.15
"""Least duration of a smooth motion."""
_RAMP_S = 0.1
"""Duration of the acceleration, and of the deceleration, of a steady motion."""
_GAIN = 0.6  # acceleration and deceleration of a paced motion, [m/s^2]
_CELL_M = 2e-5  # spacing at which the speed of a paced motion is computed


@final
@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion of the tip between two poses: position along a straight line, rotation about one fixed axis."""

    start: Array
    """Pose, (4, 4), world."""
    end: Array
    """Pose, (4, 4), world."""
    seconds: float
    """Duration."""
    progress: Callable[[Array], Array]
    """Time / seconds in [0, 1] -> fraction of the way in [0, 1]."""

    @property
    def length(self) -> float:
        """Length of the straight line, [m]."""
        return distance(self.start, self.end)

    @cached_property
    def turn(self) -> Array:
        """The rotation vector from start to end, (3,), in the frame of the start, [rad]."""
        return _turn_between(self.start, self.end)

    def poses(self, s: Array) -> Array:
        """Return the poses, (k, 4, 4), at fractions of the way, (k,)."""
        T = np.zeros((len(s), 4, 4))
        T[:, :3, :3] = self.start[:3, :3]
        if self.turn.any():
            turns = pose.exp(np.hstack([np.zeros((len(s), 3)), s[:, None] * self.turn]))
            T[:, :3, :3] = self.start[:3, :3] @ turns[:, :3, :3]
        T[:, :3, 3] = self.start[:3, 3] + s[:, None] * (self.end[:3, 3] - self.start[:3, 3])
        T[:, 3, 3] = 1.0
        return T


def distance(start: Array, end: Array) -> float:
    """Return the distance between the positions of two poses, [m]."""
    return math.dist(start[:3, 3], end[:3, 3])


def smooth_trajectory(start: Array, end: Array, speed: float, turn_speed: float = 1.5) -> Trajectory:
    """Return a minimum-jerk trajectory, at rest at both ends, with bounded peak speeds [m/s] and [rad/s]."""
    turn = math.hypot(*_turn_between(start, end))
    seconds = max(_SHORTEST_S, _PEAK * distance(start, end) / speed, _PEAK * turn / turn_speed)
    return Trajectory(start, end, seconds, interpolate_minimum_jerk)


def plan_steady_trajectory(start: Array, end: Array, speed: float) -> Trajectory:
    """Return a trajectory of constant speed [m/s] with a short ramp at both ends, for motions that a guard may stop."""
    seconds = max(distance(start, end) / speed + _RAMP_S, 2.0 * _RAMP_S)
    return Trajectory(start, end, seconds, _Trapezoid(_RAMP_S / seconds))


def plan_paced_trajectory(
    start: Array, end: Array, quick: float, slow: float, stretches: Sequence[tuple[float, float]]
) -> Trajectory:
    """Return a trajectory with bounded acceleration that is slow along some stretches.

    Args:
        quick: Speed outside of the stretches, [m/s].
        slow: Speed along them, [m/s].
        stretches: Begin and end of each, as distances from the start, [m].
    """
    far = distance(start, end)
    x = np.linspace(0.0, far, max(2, round(far / _CELL_M)) + 1)
    limit = np.full(len(x), quick)
    for begin, stop in stretches:
        limit[(x >= begin) & (x <= stop)] = slow
    limit[[0, -1]] = 0.0
    # v^2 grows by at most 2 a per metre: forwards, the least of limit^2 - 2 a x so far, plus 2 a x, is the largest v^2
    # that can be reached; backwards the same, so that speed is lost in time. Then t is the integral of dx / v, where v
    # changes linearly with time in a cell.
    squares = limit**2
    gain = 2.0 * _GAIN * (x[1] - x[0]) * np.arange(len(x))
    squares = np.minimum.accumulate(squares - gain) + gain
    squares = (np.minimum.accumulate((squares + gain)[::-1]) - gain[::-1])[::-1]
    v = np.sqrt(squares)
    t = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(x) / (v[1:] + v[:-1]))])
    return Trajectory(start, end, float(t[-1]), _Table(t / t[-1], x / far))


def interpolate_minimum_jerk(t: Array) -> Array:
    """Return the progress 10 t^3 - 15 t^4 + 6 t^5 at times t in [0, 1] (Flash and Hogan, 1985)."""
    return t**3 * (10.0 + t * (-15.0 + 6.0 * t))


@final
@dataclass(frozen=True)
class _Trapezoid:
    """Progress at constant speed between two linear ramps of the speed."""

    ramp: float
    """Duration of each ramp as a fraction of the whole time."""

    def __call__(self, t: Array) -> Array:
        r = self.ramp
        top = 1.0 - self.ramp  # begin of the second ramp, and the area under the trapezoid of height 1
        # The integral of this trapezoid: parabola, line, parabola.
        s = np.where(t < r, t * t / (2 * r), np.where(t > top, top - (1.0 - t) ** 2 / (2 * r), t - r / 2))
        return s / top


@final
@dataclass(frozen=True, eq=False)
class _Table:
    """Progress by linear interpolation between fractions of the way, `parts`, at fractions of the time, `times`."""

    times: Array
    parts: Array

    def __call__(self, t: Array) -> Array:
        return np.interp(t, self.times, self.parts)


def _turn_between(start: Array, end: Array) -> Array:
    """Return the rotation vector from one pose to another, (3,), in the frame of the first, [rad]."""
    return rotation_vector(start[:3, :3].T @ end[:3, :3])


def measure_turn(rest: Array, T: Array) -> float:
    """Return the turn about the vertical from the pose `rest` of a tip that looks down to T, -pi to pi, [rad]."""
    a = rest[:2, 0]  # level part of the tip's x axis
    b = T[:2, 0]
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def waypoints_unwound(rest: Array, start: Array, end: Array) -> tuple[Array, ...]:
    """Return the waypoints from start to end, the end included, on which the wrist does not wind up.

    The shorter turn may pass a half turn away from `rest`, where the range of the wrist ends. Then the tip turns the
    other way, by a waypoint in the middle.
    """
    a = measure_turn(rest, start)
    b = measure_turn(rest, end)
    if abs(b - a) <= np.pi:
        return (end,)
    return (_halfway(start, (start[:3, 3] + end[:3, 3]) / 2, b - a), end)


def waypoints_around(base: Array, rest: Array, start: Array, end: Array) -> tuple[Array, ...]:
    """Return one waypoint on a circle around the base of the arm, and the end.

    The tip passes the base on the side of its pose `rest`, as far from the base as the farther of both ends.

    Args:
        base: Position of the base, (3,), world, [m].
    """
    front = rest[:2, 3] - base[:2]

    def angle(T: Array) -> float:
        """Angle about the base from the direction of `rest` to the tip at T, [rad]."""
        x, y = T[:2, 3] - base[:2]
        return float(np.arctan2(front[0] * y - front[1] * x, front @ (x, y)))

    turn = (angle(start) + angle(end)) / 2 + np.arctan2(front[1], front[0])
    far = max(float(np.linalg.norm(T[:2, 3] - base[:2])) for T in (start, end))
    at = np.array([base[0] + far * np.cos(turn), base[1] + far * np.sin(turn), max(start[2, 3], end[2, 3])])
    return (_halfway(start, at, measure_turn(rest, end) - measure_turn(rest, start)), end)


def _halfway(start: Array, at: Array, turn: float) -> Array:
    """Return a pose at a position, (3,), with the orientation of `start` turned about the vertical by `turn / 2`."""
    c, s = np.cos(turn / 2), np.sin(turn / 2)
    T = np.array(start)
    T[:3, 3] = at
    T[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ start[:3, :3]
    return T


def translate(T: Array, along: Array, by: float) -> Array:
    """Return the pose shifted by `by`, [m], times a vector in the world, (3,)."""
    out = np.array(T)
    out[:3, 3] += by * np.asarray(along)
    return out


def move_to_height(T: Array, height: float) -> Array:
    """Return the pose lifted or lowered to a height in the world, [m]."""
    out = np.array(T)
    out[2, 3] = height
    return out
