"""Laws of motion that follow a force across a hole and into it.

The robot calls a law once a physics step with the force on the part in the hand; it returns where the tip goes next.
"""

import math
from collections.abc import Sequence

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.robot import Guard, LowPass

PITCH_M = 0.00035
"""Distance between the turns of a spiral; the usual play of 0.5 mm is wider."""
_ACROSS = 0.01  # [m/s] along the spiral
_FEED = 0.005  # [m/s] ahead where nothing pushes back
_EASE = 0.02  # [m/s] ahead in a hole
_SOFT = 0.02
"""How fast the speed ahead grows, [m/s^2]: what lost touch by a few hundredths of a millimetre comes back softly."""
_YIELD = 0.0005
"""How fast the tip gives way to a newton, [m/s/N]: the arm pushes with some 100 N per mm, and faster it rattles."""
_AVERAGED_S = 0.01
"""Forces are averaged over this time: hard parts rattle."""
_INNER_M = 0.0005
"""Inside this radius the spiral is slower: around its middle it would turn at once."""
_PATIENCE = 3.0  # a spiral ends after so many times the time that its length takes
_DOWN_S = 1.0  # and this long for the way ahead


class _PushFilter:
    """The force on the part, averaged: called once a physics step."""

    def __init__(self, guard: Guard, step_s: float) -> None:
        self._direction = guard.direction.tolist()
        self._step_s = step_s
        self._averaged = LowPass(_AVERAGED_S)

    def __call__(self, force: Sequence[float]) -> tuple[float, list[float]]:
        """How hard it is pushed back, [N], and the rest of the force, across, (3,), [N]."""
        averaged = self._averaged(force, self._step_s)
        push = -sum(f * w for f, w in zip(averaged, self._direction, strict=True))
        return push, [f + push * w for f, w in zip(averaged, self._direction, strict=True)]


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
        first = np.cross((0.0, 0.0, 1.0) if abs(guard.direction[2]) < 0.5 else (0.0, 1.0, 0.0), guard.direction)
        first /= np.linalg.norm(first)
        self._axes = np.array([first, np.cross(guard.direction, first)])
        self._filtered = _PushFilter(guard, step_s)
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
        """Displacement of the tip from the start of the search, (3,), world, [m]; None when the search ends."""
        push, across = self._filtered(force)
        side = math.hypot(*across)
        self.found = self._ahead > self.deep
        self._left = self._left - 1
        if self.found or self._r > self.radius or self._left < 0 or side > push + self.guard.newton:
            return None
        # In contact the tip pushes with the force that is left up to `press`, and follows the spiral
        # radius = pitch * angle / (2 pi) at constant arc speed: d angle = d arc / radius. Without contact it advances.
        if push > self.press / 4:
            self._speed = _YIELD * (self.press - push)
            self._angle += self.step_s * _ACROSS / max(self._r, _INNER_M)
        else:
            self._speed = min(max(self._speed, 0.0) + self.step_s * _SOFT, _FEED)
        self._ahead += self.step_s * self._speed
        return self.aside + self._ahead * self.guard.direction


class Easing:
    """Ahead, and across to where walls push: it ends after a length, or where the guard stops it."""

    def __init__(self, guard: Guard, length: float, step_s: float) -> None:
        self.guard = guard
        self.length = length
        self.step_s = step_s
        self._filtered = _PushFilter(guard, step_s)
        self._offset = np.zeros(3)
        self._ahead = 0.0
        self.stopped = False

    def __call__(self, force: Sequence[float]) -> Array | None:
        """How far the tip moves from where it began, (3,), world, [m]; None at the end."""
        push, side = self._filtered(force)
        self.stopped = push > self.guard.newton
        if self.stopped or self._ahead >= self.length:
            return None
        ahead = min(self.step_s * _EASE, self.length - self._ahead)
        across = self.step_s * _YIELD * np.array(side)
        self._ahead = self._ahead + ahead
        self._offset = self._offset + across + ahead * self.guard.direction
        return self._offset
