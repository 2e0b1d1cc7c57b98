"""Control laws for `servo`: a spiral search for a hole, and the compliant insertion that follows.

The robot calls a law at each physics step with the force on the held part. The law returns the displacement of the tip
from where the motion began, or None to end.
"""

import math
from collections.abc import Sequence

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.robot import Guard, LowPass

PITCH_M = 0.00035
"""Distance between the turns of a spiral; smaller than the usual clearance of 0.5 mm."""
_ACROSS = 0.01  # speed [m/s] along the spiral
_FEED = 0.005  # greatest speed [m/s] ahead without contact
_EASE = 0.02  # speed [m/s] ahead in a hole
_SOFT = 0.02
"""Acceleration ahead without contact, [m/s^2]: low, so that a part that lost contact returns to it softly."""
_YIELD = 0.0005
"""Admittance of the tip, [m/s/N]. The arm pushes with some 100 N per mm, and chatters with a higher admittance."""
_AVERAGED_S = 0.01
"""Time constant of the force filter, since contacts of hard parts chatter."""
_INNER_M = 0.0005
"""Radius inside which the angular speed of the spiral is constant, since constant arc speed would have no bound."""
_PATIENCE = 3.0  # time limit of a spiral, in multiples of the time that its length takes
_DOWN_S = 1.0  # further time for the way ahead, [s]


class _PushFilter:
    """A low pass on the force on the held part, split into a push back and a lateral force."""

    def __init__(self, guard: Guard, step_s: float) -> None:
        self._direction = guard.direction.tolist()
        self._step_s = step_s
        self._averaged = LowPass(_AVERAGED_S)

    def __call__(self, force: Sequence[float]) -> tuple[float, list[float]]:
        """Filter the force of one physics step, (3,), world, [N].

        Returns:
            The force against the direction of the guard, [N], and the lateral rest of the force, (3,), world, [N].
        """
        averaged = self._averaged(force, self._step_s)
        push = -sum(f * w for f, w in zip(averaged, self._direction, strict=True))
        return push, [f + push * w for f, w in zip(averaged, self._direction, strict=True)]


class Spiral:
    """A spiral search: move across while the part is pushed back, and ahead otherwise, until it drops into the hole."""

    def __init__(self, guard: Guard, press: float, radius: float, deep: float, step_s: float) -> None:
        """Begin in the middle.

        Args:
            guard: Direction ahead. A lateral force above the push plus the limit of the guard ends the search, since
                friction cannot cause it: the part is held by walls.
            press: The push ahead during the motion across, [N].
            radius: Greatest radius of the spiral, [m].
            deep: Distance ahead from which the hole counts as found, [m].
            step_s: Physics step, [s].
        """
        self.guard = guard
        self.press = press
        self.radius = radius
        self.deep = deep
        self.step_s = step_s
        first = np.cross((0.0, 0.0, 1.0) if abs(guard.direction[2]) < 0.5 else (0.0, 1.0, 0.0), guard.direction)
        first /= np.linalg.norm(first)
        self._axes = np.array([first, np.cross(guard.direction, first)])  # of the plane of the spiral, as rows
        self._filtered = _PushFilter(guard, step_s)
        self._ahead = 0.0  # displacement along the direction, [m]
        self._speed = 0.0  # of this displacement, [m/s]
        self._angle = 0.0  # along the spiral from its middle, [rad]
        # Steps until the time limit; a spiral of this radius and pitch has the length pi radius^2 / pitch.
        self._left = round((_PATIENCE * np.pi * radius**2 / PITCH_M / _ACROSS + _DOWN_S) / step_s)
        self.found = False

    @property
    def aside(self) -> Array:
        """Lateral displacement from the middle of the spiral, (3,), world, [m]."""
        return np.array([self._r * math.cos(self._angle), self._r * math.sin(self._angle)]) @ self._axes

    @property
    def _r(self) -> float:
        """Present radius of the spiral, [m]."""
        return PITCH_M * self._angle / (2.0 * math.pi)

    def __call__(self, force: Sequence[float]) -> Array | None:
        """Return the displacement of the tip from the start of the search, (3,), world, [m]; None at its end."""
        push, across = self._filtered(force)
        side = math.hypot(*across)
        self.found = self._ahead > self.deep
        self._left = self._left - 1
        if self.found or self._r > self.radius or self._left < 0 or side > push + self.guard.newton:
            return None
        # In contact the tip pushes with the force that is left up to `press`, and follows the spiral
        # radius = pitch * angle / (2 pi) at constant arc speed: d angle = d arc / radius. Without contact it advances.
        if push > self.press / 4:  # in contact
            self._speed = _YIELD * (self.press - push)
            self._angle += self.step_s * _ACROSS / max(self._r, _INNER_M)
        else:
            self._speed = min(max(self._speed, 0.0) + self.step_s * _SOFT, _FEED)
        self._ahead += self.step_s * self._speed
        return self.aside + self._ahead * self.guard.direction


class Easing:
    """A compliant insertion: move ahead, give way to lateral forces, and end after a length or at the guard's limit."""

    def __init__(self, guard: Guard, length: float, step_s: float) -> None:
        """Begin at the present place of the tip.

        Args:
            guard: Direction ahead and the force limit.
            length: Distance ahead at which the motion ends, [m].
            step_s: Physics step, [s].
        """
        self.guard = guard
        self.length = length
        self.step_s = step_s
        self._filtered = _PushFilter(guard, step_s)
        self._offset = np.zeros(3)
        self._ahead = 0.0
        self.stopped = False

    def __call__(self, force: Sequence[float]) -> Array | None:
        """Return the displacement of the tip from where it began, (3,), world, [m]; None at the end."""
        push, side = self._filtered(force)
        self.stopped = push > self.guard.newton
        if self.stopped or self._ahead >= self.length:
            return None
        ahead = min(self.step_s * _EASE, self.length - self._ahead)
        across = self.step_s * _YIELD * np.array(side)
        self._ahead = self._ahead + ahead
        self._offset = self._offset + across + ahead * self.guard.direction
        return self._offset
