"""The policy `spiral`: the search of the method `+spiral`, at 20 Hz from the observations of a learner."""

import math
from collections.abc import Mapping
from typing import Any, final

import numpy as np

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.policies import aim_at
from apo_bench.geometry import Array

_PITCH_MM = 0.35  # between the turns of the spiral
_ACROSS_MM = 0.2  # along the spiral with each action
_RADIUS_MM = 2.0  # of the first spiral
_YAWED_RADIUS_MM = 1.0  # of the spirals of a part that is turned about the insertion axis
_INNER_MM = 0.5  # radius inside of which the angular speed is constant
_YAWS_DEG = (0.0, 1.0, -1.0, 2.0, -2.0)  # turns of the part, one for each spiral
_STALLED = 8  # actions without progress after which the approach counts as stopped
_PROGRESS_MM = 0.05  # least progress of an action that is not stopped
_PATIENCE = 40  # actions without resistance for which the approach goes on alone
_DEEP_MM = 1.0  # progress after a stop that means that the hole is found
_NEAR_MM = 1.0  # distance left below which a stop is no reason to search
_SIDE_N = 1.9  # side force above the push at which walls hold the part


@final
class SpiralPolicy:
    """A spiral across the insertion axis where the approach is stopped, as long as the part meets resistance."""

    def __init__(self, env: APOInsert) -> None:
        self._env = env
        self._best = math.inf
        self._waited = 0
        self._stopped: float | None = None
        self._press = 0.0
        self._angle = 0.0
        self._yaw = 0
        self._target = np.zeros(6)  # [mm, deg]

    def __call__(self, observation: Mapping[str, Any]) -> Array:
        left = float(observation["plan"][3])
        push = -float(observation["wrench"][2])
        if self._stopped is None or left < self._stopped - _DEEP_MM:
            self._approach(left, push)
        else:
            self._waited = self._waited + 1 if push < self._press / 4 else 0
            if not 0 < self._waited < _PATIENCE:
                self._search(push, math.hypot(*observation["wrench"][:2]))
        return aim_at(self._env, self._target)

    def _approach(self, left: float, push: float) -> None:
        """Leave the motion to the approach, and note where it is stopped."""
        self._waited = 0 if left < self._best - _PROGRESS_MM or self._stopped is not None else self._waited + 1
        self._stopped = None
        self._best = min(self._best, left)
        if self._waited >= _STALLED and left > _NEAR_MM:
            self._stopped, self._press = left, max(push, 0.1)
            self._waited = self._yaw = 0
            self._angle = 0.0

    def _search(self, push: float, side: float) -> None:
        """Move on along the spiral; begin the next one at its end, and where walls hold the part."""
        r = _PITCH_MM * self._angle / (2 * math.pi)
        if r > (_YAWED_RADIUS_MM if self._yaw else _RADIUS_MM) or side > push + _SIDE_N:
            self._yaw = (self._yaw + 1) % len(_YAWS_DEG)
            self._angle = r = 0.0
        self._angle += _ACROSS_MM / max(r, _INNER_MM)
        r = _PITCH_MM * self._angle / (2 * math.pi)
        self._target[:2] = r * math.cos(self._angle), r * math.sin(self._angle)
        self._target[5] = _YAWS_DEG[self._yaw]
