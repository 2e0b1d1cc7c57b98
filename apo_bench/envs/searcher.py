"""The policy `searcher`: search where the stated relative error is large, and yield where forces tell it.

Where contact stops the part, the tip moves in steps along a growing ellipse whose axes are proportional to the stated
standard deviations of the part relative to the hole, less the play; across an axis that is known, it is a sweep. It
steps only while the part is pushed back, and rests after each step, so that the friction of parts that move along fades
and the part can drop. Where walls hold the part in place, the search begins again with another turn about the axis;
where the part has dipped in a little, a narrower one begins there. Everywhere else it yields to the side force until
walls do not rub, and goes in. Where the part is soon stopped again, that was no hole: it is drawn back, and the search
goes on.

Where a hole holds the part already, side forces are those of this hole, and of its part, which moves along: they say
nothing of the next hole. There the search is a circle, and each step makes up for what the tip yielded, until the part
dips in.
"""

import math
from collections.abc import Mapping
from typing import Any, final

import numpy as np

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.policies import aim_at
from apo_bench.geometry import Array

_FILTER = 0.4  # weight of the newest side force
_PROGRESS_MM = 0.05  # least progress of an action that is not stopped
_STALLED = 4  # actions without progress after which a contact ahead has stopped the part
_NEAR_MM = 1.0  # distance left below which a stop is no reason to search
_AGAIN_MM = 1.0  # distance from the last stop within which the last search goes on
_HOLE_MM = 10.0  # least depth of a hole beyond the last stop
_BACK_MM = 0.2  # distance before the last stop to which the part is drawn out of what is no hole,
_BACK = 20  # within so many actions,
_SKIPPED = 3  # and so many steps away
_SIGMAS = 3.0  # half axes of the first ellipse, in stated standard deviations,
_PLAY_MM = 0.3  # less this: a smaller error needs no search
_MOST_MM = 3.0  # greatest half axis of the first ellipse
_WIDER = 0.4  # growth of the half axes after each round of turns
_TURNED = 0.5  # half axes of an ellipse with a turn, in those without
_DIPPED_MM = 0.3  # depth beyond the last stop from which the part is near its place: from there on,
_NARROW_MM = 0.5  # this is the half axis of the first ellipse
_PITCH_MM = 0.35  # between turns
_TURNS = 1.5  # turns, in pitches of the smaller half axis,
_LEAST_TURNS = 2  # but at least these
_STEP_MM = 0.35  # along the ellipse
_LONGEST_MM = 0.5  # greatest step where a hole holds the part
_YAWS = (0.0, 1.0, -1.0, 2.0, -2.0)  # turns about the axis, one for each search, in stated standard deviations
_REST = 1  # actions after each step
_CALM = 25  # actions without resistance for which the approach goes on alone
_ENTERED_MM = 0.5  # progress after a stop that means that the part is in the hole
_FRICTION = 0.8  # side force that friction explains, as a share of the push,
_MARGIN_N = 0.5  # and on top of this share: beyond both, walls hold the part
_YIELD_MM_N = 0.6  # displacement of the tip by a side force with each action
_YIELD_MM = 0.2  # greatest displacement of an action
_HOLES = 2.0  # error relative to the next hole, where one holds the part, in those relative to the mean of both
_DIP_MM = 0.05  # depth beyond a stop from which the part dips into the next hole
_LIFT_N = 0.3  # side force of what is lifted or drawn along
_WALL_N = 1.5  # side force on top of friction at which walls hold the part in place
_NOISE_N = 0.02  # side force that is noise
_RUB_N = 0.06  # side force above which the part waits
_FREE_MM = 1.5  # progress of an action in free air
_PUSHED_N = 0.3  # push of a contact ahead
_QUIET = 6  # actions after it in which the approach goes on alone
_DRIVE = 0.5  # action along the axis that is added to the approach


@final
class Searcher:
    """The policy during one episode; its state is the phase, and where it is in its search."""

    def __init__(self, env: APOInsert) -> None:
        self._env = env
        self._phase = self._advance
        self._target = np.zeros(6)  # [mm, deg]
        self._side = np.zeros(2)  # filtered side force, [N]
        self._push = 0.0  # force against the direction, [N]
        self._quiet = 0  # actions since a contact ahead
        self._left = math.inf  # distance left, [mm]
        self._gained = math.inf  # by the last action, [mm]
        self._best = math.inf  # smallest distance left so far, [mm]
        self._waited = 0  # actions since then
        self._stopped = math.inf  # distance left where contact stopped the part, [mm]
        self._press = 0.0  # push at that moment, [N]
        self._tip = np.zeros(2)  # of the front of the part, by the encoders, [mm]
        self._first = np.zeros(2)  # where the search began, [mm]
        self._middle = np.zeros(2)  # of the ellipse, [mm]
        self._aim = np.zeros(2)  # on the ellipse, [mm]
        self._held = False  # whether a hole holds the part
        self._dipped = False  # whether the part was deeper at its last stop than at the one before
        self._angle = 0.0  # along the ellipse, [rad]
        self._searches = 0  # that are over
        self._calm = 0  # actions without resistance
        self._rested = 0  # actions since the last step

    def __call__(self, observation: Mapping[str, Any]) -> Array:
        self._tip = np.asarray(observation["agent_pos"][:2], np.float64)
        self._read(np.asarray(observation["wrench"], np.float64), float(observation["plan"][3]))
        ahead = self._phase(np.asarray(observation["plan"][6:12], np.float64))
        return aim_at(self._env, self._target, ahead)

    def _read(self, wrench: Array, left: float) -> None:
        """Take the present measurements."""
        self._side += _FILTER * (wrench[:2] - self._side)
        self._push = -float(wrench[2])
        self._quiet = 0 if self._push > _PUSHED_N else self._quiet + 1
        self._gained = self._left - left
        self._left = left
        self._waited = 0 if left < self._best - _PROGRESS_MM else self._waited + 1
        self._best = min(self._best, left)

    def _advance(self, deviations: Array) -> float:
        """Yield to the side force and go on while walls do not rub, until contact stops the part."""
        if self._waited >= (_STALLED if self._push > _PUSHED_N else _CALM) and self._left > _NEAR_MM:
            return self._begin_search(deviations)
        if self._gained > _FREE_MM:
            return 0.0
        self._target[:2] += self._yielded(_NOISE_N)
        if math.hypot(*self._side) > _RUB_N:  # take back the last progress, but draw no part out
            return -float(np.clip(self._gained, 0.0, 1.0))
        return _DRIVE if self._stopped < math.inf and self._quiet > _QUIET else 0.0

    def _begin_search(self, deviations: Array) -> float:
        """Search from here on; where the part was stopped before, or from what is no hole, the last search goes on."""
        deeper = self._stopped - self._left
        self._waited = self._calm = 0
        if _AGAIN_MM < deeper < _HOLE_MM:
            self._phase = self._draw_back
            for _ in range(_SKIPPED):
                self._step(deviations)
            return -1.0
        if abs(deeper) > _AGAIN_MM:
            self._held = _HOLE_MM < deeper < math.inf
            self._dipped = False
            self._searches = 0
            self._angle = 0.0
            self._begin_here()
        elif deeper > _DIPPED_MM:
            self._dipped = True
            self._begin_ellipse()
            self._begin_here()
        self._phase = self._search
        self._stopped = self._left
        self._press = max(self._push, 0.1)
        return 0.0

    def _draw_back(self, deviations: Array) -> float:
        """Draw the part back to before the last stop."""
        if self._left < self._stopped + _BACK_MM and self._waited < _BACK:
            return -1.0
        self._phase = self._search
        return 0.0

    def _search(self, deviations: Array) -> float:
        """Step along the ellipse while the part meets resistance."""
        if self._left < self._stopped - _ENTERED_MM:
            self._phase = self._advance
            self._best, self._waited = self._left, 0
            return 0.0
        if self._follows_force:
            self._middle = self._middle + self._yielded(self._friction + _MARGIN_N)
        lifts = not self._follows_force and math.hypot(*self._side) > _LIFT_N
        self._calm = self._calm + 1 if self._push < self._press / 4 and not lifts else 0
        self._rested += 1
        if self._rested > _REST and not 0 < self._calm < _CALM:
            self._rested = 0
            if not self._held and self._is_fixed:
                self._begin_turned()
            self._step(deviations)
        return 0.0

    @property
    def _follows_force(self) -> bool:
        """Whether side forces are those of the hole that is searched."""
        return not self._held or self._left < self._stopped - _DIP_MM

    @property
    def _friction(self) -> float:
        """Greatest side force that friction explains, [N]."""
        return _FRICTION * max(self._push, 0.0)

    @property
    def _is_fixed(self) -> bool:
        """Whether walls hold the part in place."""
        return math.hypot(*self._side) > self._friction + _WALL_N

    def _begin_here(self) -> None:
        """Search about the tip as it is."""
        self._first = self._middle = self._aim = self._tip

    def _begin_turned(self) -> None:
        """Search again from the beginning with another turn, since walls hold the part, which does not go in."""
        self._middle = self._first
        self._begin_ellipse()

    def _begin_ellipse(self) -> None:
        """Begin the next ellipse, to the other side and with another turn."""
        self._searches += 1
        self._angle = 0.0

    def _step(self, deviations: Array) -> None:
        """Move on along the ellipse; begin the next one at its end."""
        axes = self._half_axes(deviations[:2])
        turns = max(math.ceil(_TURNS * float(axes.min()) / _PITCH_MM), _LEAST_TURNS)
        whole = 2 * math.pi * turns
        if self._angle > whole:
            self._begin_ellipse()
        along = math.hypot(axes[0] * math.sin(self._angle), axes[1] * math.cos(self._angle))  # for each radian
        share = self._angle / whole  # of the largest ellipse
        self._angle += _STEP_MM / max(share * max(along, float(axes.max()) / 2), _PITCH_MM)
        aside = axes * (math.cos(self._angle), math.sin(self._angle)) * (-1) ** self._searches
        aim = self._middle + self._angle / whole * aside
        if self._follows_force:
            self._target[:2] += aim - self._aim
        elif not self._is_fixed:
            ahead = aim - self._tip
            self._target[:2] += ahead * min(1.0, _LONGEST_MM / max(math.hypot(*ahead), _LONGEST_MM))
        self._aim = aim
        self._target[5] = _YAWS[self._searches % len(_YAWS)] * deviations[5]

    def _half_axes(self, deviations: Array) -> Array:
        """Return the half axes of the present ellipse, (2,), [mm]."""
        rounds, turned = divmod(self._searches, len(_YAWS))
        wider = 1.0 + _WIDER * rounds
        if self._dipped:
            return np.full(2, _NARROW_MM * wider)
        sigmas = np.full(2, _HOLES * deviations.min()) if self._held else deviations
        return np.clip(_SIGMAS * sigmas - _PLAY_MM, 0.0, _MOST_MM) * wider * (_TURNED if turned else 1.0)

    def _yielded(self, beyond: float) -> Array:
        """Return by how much the tip yields to the side force beyond a size, [N]: (2,), [mm]."""
        size = math.hypot(*self._side)
        return self._side * (min(_YIELD_MM_N * (size - beyond), _YIELD_MM) / size) if size > beyond else np.zeros(2)
