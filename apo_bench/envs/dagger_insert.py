"""The policy `dagger-insert`: a small network that imitates the teacher `expert`, by DAgger."""

from collections import deque
from functools import cache
from typing import Any, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.resources import folder

HISTORY = 6
"""Number of latest observations among the inputs of the network."""
WIDTH = 128  # units of each hidden layer
_SIDE = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])  # signs in the mirror image along the first axis
_OTHER_SIDE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # signs in the mirror image along the second axis
MIRRORS = np.array([np.ones(6), _SIDE, _OTHER_SIDE, _SIDE * _OTHER_SIDE])
"""(4, 6): signs of (translation, rotation), or (force, torque), in the mirror images of the first two axes.

A rotation is a pseudovector, so its component along the mirrored axis keeps its sign.
"""
_VECTORS = np.array([[0.2] * 6, [0.1] * 6, [0.2] * 3 + [0.02] * 3, [0.5] * 6])
"""(4, 6): scales of tip error [mm, deg], lag [mm, deg], wrench [N, Nm] and last action.

arcsinh of the scaled input is linear up to about the scale and logarithmic beyond.
"""
_NUMBERS = np.array([0.1, 1.0, 0.2, *[0.2] * 6, 2.0])
"""Scales of opening, axis direction z, distance lost again, six standard deviations, actions without progress."""
_UNIT = np.repeat([1.0, 0.5], 3)
"""Translation and rotation of an action of 1, (6,), [mm, deg], as in the environment's defaults."""
_GAIN = 0.5
"""Share of the error that one action corrects, as in the teacher."""
SLOWLY = 0.1
"""Weight of the newest target of the network in the moving average; without averaging, the part would shake."""
FORWARD_MM = 0.3
"""Progress [mm] of an action in free air; after an action with less, the part counts as in contact."""
# size of the inputs that are vectors of six: those of the history and the push
VECTORS = (HISTORY * len(_VECTORS) + 1) * 6
SHAPES = ((VECTORS + len(_NUMBERS), WIDTH), (WIDTH, WIDTH), (WIDTH, 6))
"""Input and output size of each layer."""


@final
class DaggerInsert:
    """A policy for one episode, called as `policy(env, seen)`; it uses the observations and never the environment."""

    def __init__(self, weights: dict[str, Array] | None = None) -> None:
        """Start an episode.

        Args:
            weights: `w0`, `b0`, `w1`, ...; default: the trained weights of the package.
        """
        self._weights = _weights() if weights is None else weights
        self._past: deque[Array] = deque(maxlen=HISTORY)  # scaled vectors of the last observations, newest first
        self._free: list[Array] = []  # wrenches in free air
        self._held: list[Array] = []  # wrenches since the last progress
        self._left = np.inf  # distance left at the observation before
        self._there: Array | None = None  # moving average of the target, (6,), in units of an action

    def __call__(self, env: Any, seen: dict[str, Any]) -> Array:
        return self.act(seen, self.encode(seen))

    def act(self, seen: dict[str, Any], inputs: Array) -> Array:
        """Return an action, (7,), across the axis and in rotation, towards the averaged target.

        Args:
            inputs: Inputs of the network, of `encode`.
        """
        at = seen["agent_pos"][:6] / _UNIT
        there = at + predict_error(self._weights, inputs) / _GAIN  # the network predicts the gain times the error
        self._there = there if self._there is None else self._there + SLOWLY * (there - self._there)
        aside = np.clip(_GAIN * (self._there - at), -1.0, 1.0)
        aside[2] = 0.0  # the scripted approach moves along the axis
        return np.append(aside, 0.0)

    def encode(self, seen: dict[str, Any]) -> Array:
        """Return the inputs of the network, (VECTORS + 10,), and update the history.

        The inputs are the scaled vectors of the last observations, newest first, then the push, then single numbers.
        The push is the mean wrench since the last progress minus the mean in free air; one reading alone is noisier
        than the effect of a light push on a rim. At the start the first observation fills the history.
        """
        agent, plan, wrench = (np.asarray(seen[name], np.float64) for name in ("agent_pos", "plan", "wrench"))
        if self._left - plan[3] > FORWARD_MM:  # plan[3] is the distance left
            self._free.append(wrench)
            self._held.clear()
        else:
            self._held.append(wrench)
        self._left = plan[3]
        push = np.mean(self._held or [wrench], axis=0) - np.mean(self._free, axis=0)
        sight = np.array([agent[:6], agent[6:12], wrench, plan[12:18]])  # tip error, lag, wrench, last action
        self._past.appendleft(np.arcsinh(sight / _VECTORS).ravel())
        self._past.extend([self._past[-1]] * (HISTORY - len(self._past)))
        # opening, axis direction z, distance lost again, standard deviations, actions without progress
        numbers = np.array([agent[12], plan[2], plan[3] - plan[4], *plan[6:12], len(self._held)])
        return np.concatenate([*self._past, np.clip(push / _VECTORS[2], -9.0, 9.0), np.arcsinh(numbers / _NUMBERS)])


def predict_error(weights: dict[str, Array], inputs: Array) -> Array:
    """Return the network's estimate of the teacher's action, (6,), averaged over the four mirror images.

    The signs of `MIRRORS` map each output back, so the policy is symmetric.
    """
    return np.asarray(np.mean(forward(weights, mirror_inputs(inputs)) * MIRRORS, axis=0))


def mirror_inputs(inputs: Array) -> Array:
    """Return the inputs in the four mirror images, (4, ...); single numbers do not change."""
    signs = np.tile(MIRRORS, (1, VECTORS // 6))
    return np.concatenate([inputs[:VECTORS] * signs, np.tile(inputs[VECTORS:], (len(MIRRORS), 1))], axis=1)


def forward(weights: dict[str, Array], x: Array) -> Array:
    """Return translations and rotations, (n, 6), in units of an action, for inputs (n, ...)."""
    for layer in range(len(SHAPES) - 1):  # hidden layers, with ReLU
        x = np.maximum(x @ weights[f"w{layer}"] + weights[f"b{layer}"], 0.0)
    return np.asarray(x @ weights[f"w{layer + 1}"] + weights[f"b{layer + 1}"])  # `layer` is the last hidden one


@cache
def _weights() -> dict[str, Array]:
    """Load the trained weights of the package."""
    with np.load(folder("assets") / "learned" / "insert.npz", allow_pickle=False) as kept:
        return {name: kept[name].astype(np.float64) for name in kept.files}
