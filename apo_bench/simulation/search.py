"""Feeling for a hole: a spiral across the way of an insertion under a light push, then the same at other yaws.

The robot knows what it commands and the force on the part in its hand, and nothing else.
"""

from __future__ import annotations

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.simulation.paths import moved, smooth
from apo_bench.simulation.robot import Guard, Robot
from apo_bench.simulation.transfer import UP

RADIUS_M, PITCH_M = 0.002, 0.00035
"""How far off the hole is looked for; the turns of the spiral are less far apart than the usual play of 0.5 mm."""
YAWS_DEG, YAWED_RADIUS_M = (1.0, -1.0, 2.0, -2.0), 0.001
"""Where nothing is found the part is turned about the vertical, and a shorter spiral follows."""
ACROSS, FEED, FASTER = 0.01, 0.005, 0.02
"""Speeds [m/s]: along the spiral while the obstacle pushes back, ahead while nothing does."""
YIELD = 0.0005
SLOW_M = 0.0005
"""How fast the tip yields to each newton that it is pushed back more than it shall be, [m/s/N]."""
EASE, PIECE_M, SMALL_M = 0.02, 0.01, 1e-6
"""In the hole it goes ahead at this speed, [m/s], in pieces of this length; less than the last is nothing."""
FELT_S = 0.01
"""Forces are taken as their mean over about this time, since hard parts chatter."""
BACK_M = 0.0005
"""So far it is drawn back before it is turned, or brought to where a spiral begins."""
DEEP_M = 0.001
"""What goes so much deeper than where it was stopped has found the hole."""
PATIENCE = 3.0
"""A spiral may take so many times as long as its path does without a stop."""
SEARCHES = 3
"""So many times a motion is searched for; what stops again is given up."""


def search(robot: Robot, guard: Guard, press: float, stopped: Array, pivot: Array, far: float = 0.0) -> Array | None:
    """Look for the hole around the tip pose where an insertion was stopped; it ends there again if there is none.

    Args:
        guard: Of the insertion; a spiral that is pushed back harder ends.
        press: The push under which the spiral is followed, [N].
        pivot: (3,), world, [m]: about the vertical through it the part is turned.

    Returns:
        What brings the poses that were meant to those that were found, (4, 4), world; None if nothing was found.
    """
    off = moved(stopped, guard.way, -BACK_M)
    for yaw, radius in ((0.0, RADIUS_M), *((np.radians(yaw), YAWED_RADIUS_M) for yaw in YAWS_DEG)):
        turn = _turned(yaw, pivot)
        robot.follow(smooth(robot.T, moved(robot.T, guard.way, -BACK_M), FEED))
        robot.follow(smooth(robot.T, turn @ off, FEED))
        spiral = Spiral(turn[:3, :3] @ guard.way, press, guard.newton, min(radius, RADIUS_M - far), robot.step_s)
        robot.servo(spiral)
        if spiral.found:
            return moved(turn, spiral.aside, 1.0)
    robot.follow(smooth(robot.T, moved(robot.T, guard.way, -BACK_M), FEED))
    robot.follow(smooth(robot.T, off, FEED))
    robot.follow(smooth(robot.T, stopped, FEED), guard)
    return None


def ease_in(robot: Robot, end: Array, guard: Guard) -> float:
    """Go on to the depth of a tip pose, giving way across; returns how much is left if the guard stops it, [m]."""
    left = float((end - robot.T)[:3, 3] @ guard.way)
    while left > SMALL_M:
        law = Easing(guard, min(left, PIECE_M), robot.step_s)
        robot.servo(law)
        left = float((end - robot.T)[:3, 3] @ guard.way)
        if law.stopped:
            return left
    return 0.0


class Easing:
    """Where the tip goes next, step by step: ahead, and across where the walls push it."""

    def __init__(self, guard: Guard, length: float, step_s: float) -> None:
        self.guard, self.length, self.step_s = guard, length, step_s
        self.force, self.offset, self.stopped = np.zeros(3), np.zeros(3), False

    def __call__(self, force: Array) -> Array | None:
        """The next offset of the tip from where it began, (3,), world, [m]; None at the end."""
        self.force += (force - self.force) * self.step_s / FELT_S
        push = -float(self.force @ self.guard.way)
        self.stopped = push > self.guard.newton
        ahead = float(self.offset @ self.guard.way)
        if self.stopped or ahead >= self.length:
            return None
        across = YIELD * (self.force + push * self.guard.way)
        self.offset = self.offset + self.step_s * across + min(self.step_s * EASE, self.length - ahead) * self.guard.way
        return self.offset


class Spiral:
    """Where the tip goes next, step by step: across while it is pushed back, ahead while it is not."""

    def __init__(self, way: Array, press: float, limit: float, radius: float, step_s: float) -> None:
        self.way, self.press, self.limit, self.radius, self.step_s = way, press, limit, radius, step_s
        first = np.cross(UP, way) if abs(way[2]) < 0.5 else np.array([1.0, 0.0, 0.0])
        first = first / np.linalg.norm(first)
        self._across = np.array([first, np.cross(way, first)])
        self.ahead, self.angle, self.speed, self.found = 0.0, 0.0, 0.0, False
        self.force = np.zeros(3)
        self.left = round(PATIENCE * np.pi * radius**2 / PITCH_M / ACROSS / step_s)

    @property
    def aside(self) -> Array:
        """How far off the middle it is, (3,), world, [m]."""
        r = PITCH_M * self.angle / (2 * np.pi)
        return np.asarray(r * np.array([np.cos(self.angle), np.sin(self.angle)]) @ self._across)

    def __call__(self, force: Array) -> Array | None:
        """The next offset of the tip from where it began, (3,), world, [m]; None at the end.

        Args:
            force: On the part in the hand, (3,), world, [N].
        """
        self.force += (force - self.force) * self.step_s / FELT_S
        push = -float(self.force @ self.way)
        aside = float(np.linalg.norm(self.force + push * self.way))
        self.found = self.ahead > BACK_M + DEEP_M
        self.left -= 1
        r = PITCH_M * self.angle / (2 * np.pi)
        if self.found or self.left <= 0 or r > self.radius or aside - push > self.limit:
            return None
        if push > self.press / 4:
            self.speed = YIELD * (self.press - push)
            self.angle += self.step_s * ACROSS / max(r, SLOW_M)
        else:
            self.speed = min(FEED, max(self.speed, 0.0) + self.step_s * FASTER)
        self.ahead += self.step_s * self.speed
        return self.aside + self.ahead * self.way


def _turned(angle: float, pivot: Array) -> Array:
    T = np.eye(4)
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    T[:3, 3] = pivot - T[:3, :3] @ pivot
    return T
