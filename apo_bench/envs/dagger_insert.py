"""The policy `dagger-insert`: a small network that imitates the teacher `expert`."""

from collections import deque
from functools import cache
from typing import Any, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.resources import folder

HISTORY = 6
"""So many of the last observations it is told."""
WIDTH = 128
_SIDE = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
_OTHER_SIDE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
MIRRORS = np.array([np.ones(6), _SIDE, _OTHER_SIDE, _SIDE * _OTHER_SIDE])
"""(4, 6): signs of a shift and a turn, or a force and a torque, in the mirrors of the first two axes of the way in."""
_VECTORS = np.array([[0.2] * 6, [0.1] * 6, [0.2] * 3 + [0.02] * 3, [0.5] * 6])
"""(4, 6): what is small of the tip, [mm, deg], its lag, the wrench, [N, Nm], and the last action. Of what is much more
it is told the logarithm."""
_NUMBERS = np.array([0.1, 1.0, 0.2, *[0.2] * 6, 2.0])
"""Alike for opening, slope of the way, way lost again, standard deviations, and for how many actions it stands."""
_UNIT = np.repeat([1.0, 0.5], 3)
"""Of an action, [mm, deg]."""
_GAIN = 0.5
"""As of the teacher."""
SLOWLY = 0.1
"""Of what the network says now, in what it is taken to say: alone, it would shake the part."""
FORWARD_MM = 0.3
"""An action by which less of the way is left is one of free air; after others it stands before something."""
VECTORS = (HISTORY * len(_VECTORS) + 1) * 6
SHAPES = ((VECTORS + len(_NUMBERS), WIDTH), (WIDTH, WIDTH), (WIDTH, 6))
"""Of the layers."""


@final
class DaggerInsert:
    """A policy of one episode: `act(env, seen)`; it looks at what is seen and never at the environment."""

    def __init__(self, weights: dict[str, Array] | None = None) -> None:
        """With the weights that come along, or with others, `w0`, `b0` and so on."""
        self._weights = _weights() if weights is None else weights
        self._past: deque[Array] = deque(maxlen=HISTORY)
        self._free: list[Array] = []
        self._held: list[Array] = []
        self._left = np.inf
        self._there: Array | None = None

    def __call__(self, env: Any, seen: dict[str, Any]) -> Array:
        return self.act(seen, self.told(seen))

    def act(self, seen: dict[str, Any], told: Array) -> Array:
        """Go across and turned to where the network has been saying that the part belongs."""
        at = seen["agent_pos"][:6] / _UNIT
        there = at + wanted(self._weights, told) / _GAIN
        self._there = there if self._there is None else self._there + SLOWLY * (there - self._there)
        aside = np.clip(_GAIN * (self._there - at), -1.0, 1.0)
        aside[2] = 0.0
        return np.append(aside, 0.0)

    def told(self, seen: dict[str, Any]) -> Array:
        """What the network is told, (VECTORS + 10,): the last sights, newest first, then a push, then numbers.

        The push is the mean wrench since it stands less that in free air: one reading is noisier than what a light
        push on a rim turns. The first sight stands for those before.
        """
        agent, plan, wrench = (np.asarray(seen[name], np.float64) for name in ("agent_pos", "plan", "wrench"))
        if self._left - plan[3] > FORWARD_MM:
            self._free.append(wrench)
            self._held.clear()
        else:
            self._held.append(wrench)
        self._left = plan[3]
        push = np.mean(self._held or [wrench], axis=0) - np.mean(self._free, axis=0)
        sight = np.array([agent[:6], agent[6:12], wrench, plan[12:18]])
        self._past.appendleft(np.arcsinh(sight / _VECTORS).ravel())
        self._past.extend([self._past[-1]] * (HISTORY - len(self._past)))
        numbers = np.array([agent[12], plan[2], plan[3] - plan[4], *plan[6:12], len(self._held)])
        return np.concatenate([*self._past, np.clip(push / _VECTORS[2], -9.0, 9.0), np.arcsinh(numbers / _NUMBERS)])


def wanted(weights: dict[str, Array], told: Array) -> Array:
    """What the network says that the teacher would do, (6,): the mean of what it is told and of its mirror images."""
    return np.asarray(np.mean(forward(weights, mirrored(told)) * MIRRORS, axis=0))


def mirrored(told: Array) -> Array:
    """What the network would be told in the four mirrors, (4, ...)."""
    signs = np.tile(MIRRORS, (1, VECTORS // 6))
    return np.concatenate([told[:VECTORS] * signs, np.tile(told[VECTORS:], (len(MIRRORS), 1))], axis=1)


def forward(weights: dict[str, Array], x: Array) -> Array:
    """Shift and turn, (n, 6), in units of an action, of what the network is told, (n, ...)."""
    for layer in range(len(SHAPES) - 1):
        x = np.maximum(x @ weights[f"w{layer}"] + weights[f"b{layer}"], 0.0)
    return np.asarray(x @ weights[f"w{layer + 1}"] + weights[f"b{layer + 1}"])


@cache
def _weights() -> dict[str, Array]:
    with np.load(folder("assets") / "learned" / "insert.npz", allow_pickle=False) as kept:
        return {name: kept[name].astype(np.float64) for name in kept.files}
