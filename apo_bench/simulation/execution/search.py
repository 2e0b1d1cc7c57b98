"""Feeling for a hole where an insertion is stopped: spirals under a light push at several yaws, then giving way.

The robot knows what it commands and the force on the part in its hand; it never reads where a part is.

Two laws of motion that follow a force: across the mouth of a hole until the part drops in, and on into the hole.

Each is called once a physics step with the force on the part in the hand, and says where the tip goes next.
"""

import math
from collections.abc import Sequence

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Guard, LowPass, Robot, Trajectory, servo, shifted, smooth

RADIUS_M = 0.002
PITCH_M = 0.00035
"""How far off a hole is looked for; the turns are less far apart than the usual play of 0.5 mm is wide."""
_ACROSS = 0.01
_FEED = 0.005
_EASE = 0.02
"""Speeds [m/s]: along the spiral, ahead where nothing pushes back, and ahead in a hole."""
_SOFT = 0.02
"""How fast the speed ahead grows, [m/s^2]: what lost touch by a few hundredths of a millimetre comes back softly."""
_YIELD = 0.0005
"""How fast the tip gives way to a newton, [m/s/N]: the arm pushes with some 100 N per mm, and faster it rattles."""
_FELT_S = 0.01
"""Forces are averaged over this time: hard parts rattle."""
_INNER_M = 0.0005
"""Inside this radius the spiral is slower: around its middle it would turn at once."""
_PATIENCE = 3.0
_DOWN_S = 1.0
"""A spiral ends after so many times the time that its length takes, and this long, [s], for the way ahead."""


class _Felt:
    """The force on the part, averaged: called once a physics step."""

    def __init__(self, guard: Guard, step_s: float) -> None:
        self._way = guard.way.tolist()
        self._step_s = step_s
        self._averaged = LowPass(_FELT_S)

    def __call__(self, force: Sequence[float]) -> tuple[float, list[float]]:
        """How hard it is pushed back, [N], and the rest of the force, across, (3,), [N]."""
        averaged = self._averaged(force, self._step_s)
        push = -sum(f * w for f, w in zip(averaged, self._way, strict=True))
        return push, [f + push * w for f, w in zip(averaged, self._way, strict=True)]


class Spiral:
    """Across while the part is pushed back, ahead while it is not: it ends where the part drops in."""

    def __init__(self, guard: Guard, press: float, radius: float, deep: float, step_s: float) -> None:
        """Begin in the middle.

        Args:
            guard: The way ahead; what is pushed from the side harder than friction and this explain is held by walls.
            press: The push under which it goes across, [N].
            radius: How far across it goes at most, [m].
            deep: What goes so far ahead has found the hole, [m].
        """
        self.guard = guard
        self.press = press
        self.radius = radius
        self.deep = deep
        self.step_s = step_s
        first = np.cross((0.0, 0.0, 1.0) if abs(guard.way[2]) < 0.5 else (0.0, 1.0, 0.0), guard.way)
        first /= np.linalg.norm(first)
        self._axes = np.array([first, np.cross(guard.way, first)])
        self._felt = _Felt(guard, step_s)
        self._ahead = 0.0
        self._speed = 0.0
        self._angle = 0.0
        self._left = round((_PATIENCE * np.pi * radius**2 / PITCH_M / _ACROSS + _DOWN_S) / step_s)
        self.found = False

    @property
    def aside(self) -> Array:
        """How far off the middle it is, (3,), world, [m]."""
        return np.array([self._r * math.cos(self._angle), self._r * math.sin(self._angle)]) @ self._axes

    @property
    def _r(self) -> float:
        return PITCH_M * self._angle / (2.0 * math.pi)

    def __call__(self, force: Sequence[float]) -> Array | None:
        """How far the tip shall be from where it began, (3,), world, [m]; None at the end."""
        push, across = self._felt(force)
        side = math.hypot(*across)
        self.found = self._ahead > self.deep
        self._left = self._left - 1
        if self.found or self._r > self.radius or self._left < 0 or side > push + self.guard.newton:
            return None
        # Pushed back, the tip goes on by what yields to the rest of the press, and along r = pitch angle / 2 pi by
        # d angle = d arc / r; let go of, it goes ahead.
        if push > self.press / 4:
            self._speed = _YIELD * (self.press - push)
            self._angle += self.step_s * _ACROSS / max(self._r, _INNER_M)
        else:
            self._speed = min(max(self._speed, 0.0) + self.step_s * _SOFT, _FEED)
        self._ahead += self.step_s * self._speed
        return self.aside + self._ahead * self.guard.way


class Easing:
    """Ahead, and across to where walls push: it ends after a length, or where the guard stops it."""

    def __init__(self, guard: Guard, length: float, step_s: float) -> None:
        self.guard = guard
        self.length = length
        self.step_s = step_s
        self._felt = _Felt(guard, step_s)
        self._offset = np.zeros(3)
        self._ahead = 0.0
        self.stopped = False

    def __call__(self, force: Sequence[float]) -> Array | None:
        """How far the tip shall be from where it began, (3,), world, [m]; None at the end."""
        push, side = self._felt(force)
        self.stopped = push > self.guard.newton
        if self.stopped or self._ahead >= self.length:
            return None
        ahead = min(self.step_s * _EASE, self.length - self._ahead)
        across = self.step_s * _YIELD * np.array(side)
        self._ahead = self._ahead + ahead
        self._offset = self._offset + across + ahead * self.guard.way
        return self._offset


YAWS_DEG = (1.0, -1.0, 2.0, -2.0)
YAWED_RADIUS_M = 0.001
"""Where the first spiral finds nothing, the part is turned about the vertical and a shorter one follows, so often."""
_BACK_M = 0.0005
_BACK = 0.005
_BRING = 0.03
"""Drawn back so far, a part touches nothing ahead; peak speeds [m/s] there, and then to where a spiral begins."""
_DEEP_M = 0.001
"""What goes so much deeper than where it was stopped has found the hole."""
SEARCHES = 3
"""A motion is searched for so many times at most, in one transfer up to twice as often."""
_PIECE_M = 0.01
_NOTHING_M = 1e-6
"""Giving way, the tip goes on in pieces of this length; less than the second is nothing."""


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
        stopped = shifted(end, guard.way, float((robot.T - end)[:3, 3] @ guard.way))
        macro = robot.macro
        robot.macro = "search"
        more = search_hole(robot, stopped, (stopped @ T_tip_front)[:3, 3], guard, t.slide_n, RADIUS_M - aside)
        robot.macro = macro
        if more is None:
            break
        guard = Guard(more[:3, :3] @ guard.way, guard.newton)
        more = shifted(more, _ease_in(robot, more @ end, guard), 1.0)
        T_search = more if T_search is None else more @ T_search
        end = more @ end
        left = float((end - robot.T)[:3, 3] @ guard.way)
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
    off = shifted(stopped, guard.way, -_BACK_M)
    for yaw in (0.0, *YAWS_DEG):
        turn = _turned(yaw, front)
        _bring(robot, turn @ off, guard.way)
        turned = Guard(turn[:3, :3] @ guard.way, guard.newton)
        far = min(radius, YAWED_RADIUS_M) if yaw else radius
        spiral = Spiral(turned, press, far, _BACK_M + _DEEP_M, robot.step_s)
        servo(robot, spiral)
        if spiral.found:
            return shifted(turn, spiral.aside, 1.0)
    _bring(robot, off, guard.way)
    robot.follow(smooth(robot.T, stopped, _BACK), guard)
    return None


def _ease_in(robot: Robot, end: Array, guard: Guard) -> Array:
    """Go on as deep as a tip pose, giving way across; returns how far aside of it that led, (3,), world, [m]."""
    while (left := float((end - robot.T)[:3, 3] @ guard.way)) > _NOTHING_M:
        easing = Easing(guard, min(left, _PIECE_M), robot.step_s)
        servo(robot, easing)
        if easing.stopped:
            break
    off = (robot.T - end)[:3, 3]
    return np.asarray(off - (off @ guard.way) * guard.way)


def _bring(robot: Robot, T: Array, way: Array) -> None:
    """Back first, so that nothing is touched on the way."""
    robot.follow(smooth(robot.T, shifted(robot.T, way, -_BACK_M), _BACK))
    robot.follow(smooth(robot.T, T, _BRING))


def _turned(yaw_deg: float, about: Array) -> Array:
    """The turn about the vertical through a point, (4, 4), world."""
    R = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, yaw_deg))[:3, :3]
    return frame(R, about - R @ about)
