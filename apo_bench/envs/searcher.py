"""The policy `searcher`: search where the stated relative error is large, and yield where forces tell it.

Where contact stops the approach, the tip follows a growing ellipse whose axes are proportional to the stated standard
deviations of the part relative to the hole. Across an axis that is known better than the play, the ellipse becomes a
line, and only the filtered side force moves the tip. Inside of the hole the side force alone does, and the part goes in
while walls do not rub.
"""

import math
from collections.abc import Mapping
from typing import Any, final

import numpy as np

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.policies import aim_at
from apo_bench.geometry import Array

_FILTER = 0.25  # weight of the newest wrench
_STALLED = 4  # actions without progress after which the approach counts as stopped
_PROGRESS_MM = 0.05  # least progress of an action that is not stopped
_NEAR_MM = 1.0  # distance left below which a stop is no reason to search
_SIGMAS = 2.5  # half axes of the largest ellipse, in stated standard deviations,
_PLAY_MM = 0.3  # less this: a smaller error needs no search
_WIDER = 0.25  # growth of the half axes with each further search
_MOST_MM = 3.0  # greatest half axis
_PITCH_MM = 0.35  # growth of the larger half axis with each turn
_SPEED_MM = 0.25  # along the ellipse with each action
_YAWS = (0.0, 1.0, -1.0, 2.0, -2.0)  # turns about the axis, one for each search, in stated standard deviations
_CALM = 25  # actions without resistance for which the approach goes on alone
_DEEP_MM = 1.5  # progress after a stop that means that the part is in the hole
_HELD_MM = 0.4  # the same where walls push it from the side
_HELD_N = 1.2  # by this side force
_YIELD_MM_N = 0.6  # displacement of the tip by a side force with each action
_YIELD_MM = 0.2  # greatest displacement of an action
_ROOM_MM = 1.2  # greatest displacement in the hole from where it was found
_DEAD_N = 0.02  # side force that is noise
_RUB_N = 0.06  # side force in the hole above which the part stands
_DRIVE_N = 0.2  # push below which the part goes in faster than the approach
_DRIVE = 0.5  # by this action
_STUCK = 30  # actions without progress in the hole after which the search goes on


@final
class Searcher:
    """The policy during one episode; its state is the phase, and where it is in its search."""

    def __init__(self, env: APOInsert) -> None:
        self._env = env
        self._phase = self._approach
        self._target = np.zeros(6)  # [mm, deg]
        self._middle = np.zeros(2)  # of the ellipse, [mm]
        self._force = np.zeros(3)  # filtered, [N]
        self._best = math.inf  # smallest distance left in this phase, [mm]
        self._waited = 0  # actions since then
        self._left = math.inf  # distance left at the last action, [mm]
        self._gained = 0.0  # by the last action, [mm]
        self._stopped = 0.0  # distance left at which contact stopped the part, [mm]
        self._press = 0.1  # push at that moment, [N]
        self._angle = 0.0  # along the ellipses, [rad]
        self._searches = 0

    def __call__(self, observation: Mapping[str, Any]) -> Array:
        self._force += _FILTER * (np.asarray(observation["wrench"][:3], np.float64) - self._force)
        left = float(observation["plan"][3])
        self._gained = self._left - left
        self._left = left
        progress = left < self._best - _PROGRESS_MM
        self._waited = 0 if progress else self._waited + 1
        self._best = min(self._best, left)
        ahead = self._phase(left, np.asarray(observation["plan"][6:12], np.float64))
        return aim_at(self._env, self._target, ahead)

    def _approach(self, left: float, deviations: Array) -> float:
        """Leave the motion to the approach until contact stops it."""
        if self._waited >= _STALLED and left > _NEAR_MM:
            self._press = max(-float(self._force[2]), 0.1)
            self._begin_search(left)
        return 0.0

    def _begin_search(self, left: float) -> None:
        """Search from here on."""
        self._phase = self._search
        self._stopped = left
        self._middle = self._target[:2].copy()
        self._waited = 0
        self._angle = 0.0

    def _search(self, left: float, deviations: Array) -> float:
        """Move on along the ellipses while the part meets resistance; go in where walls hold it."""
        is_held = math.hypot(*self._force[:2]) > _HELD_N and left < self._stopped - _HELD_MM
        if is_held or left < self._stopped - _DEEP_MM:
            self._phase = self._go_in
            self._middle = self._target[:2].copy()
            self._best, self._waited = left, 0
            return 0.0
        if -float(self._force[2]) > self._press / 4:
            self._waited = 0
        if 0 < self._waited < _CALM:
            return 0.0
        axes = np.clip(_SIGMAS * deviations[:2] - _PLAY_MM, 0.0, _MOST_MM) * (1.0 + _WIDER * self._searches)
        self._middle += np.where(axes > 0.0, 0.0, self._yielded())
        largest = float(axes.max())
        whole = 2 * math.pi * max(math.ceil(largest / _PITCH_MM), 1)  # angle of all turns
        if self._angle > whole:
            self._searches += 1
            self._angle = 0.0
        self._angle += _SPEED_MM / max(self._angle / whole * largest, _PITCH_MM)
        share = self._angle / whole  # of the largest ellipse
        self._target[:2] = self._middle + share * axes * (math.cos(self._angle), math.sin(self._angle))
        self._target[5] = _YAWS[self._searches % len(_YAWS)] * deviations[5]
        return 0.0

    def _go_in(self, left: float, deviations: Array) -> float:
        """Yield to the side force, and go in while walls do not rub; search on where the part is stuck."""
        if self._waited > _STUCK and left > _NEAR_MM:
            self._begin_search(left)
            return 0.0
        self._target[:2] = self._middle + np.clip(
            self._target[:2] + self._yielded() - self._middle, -_ROOM_MM, _ROOM_MM
        )
        if math.hypot(*self._force[:2]) > _RUB_N:  # take back the last progress, but draw no part out
            return -float(np.clip(self._gained, 0.0, 1.0))
        return _DRIVE if -float(self._force[2]) < _DRIVE_N else 0.0

    def _yielded(self) -> Array:
        """Return by how much the tip yields to the filtered side force, (2,), [mm]."""
        side = np.where(np.abs(self._force[:2]) > _DEAD_N, self._force[:2], 0.0)
        return np.clip(_YIELD_MM_N * side, -_YIELD_MM, _YIELD_MM)
