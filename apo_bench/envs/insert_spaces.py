"""What a learner sees of one operation, and the space that it is in: `docs/guide/insertion.md` has every number."""

import math
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

MM_DEG = np.repeat([1e3, 180.0 / math.pi], 3)
PIXELS = 96
_FAR = np.repeat([500.0, 180.0], 3)
_SEEN = {
    "agent_pos": np.array([*_FAR, *_FAR, 100.0]),
    "wrench": np.repeat([1000.0, 1000.0], 3),
    "plan": np.array([1.0, 1.0, 1.0, 500.0, 500.0, 1e4, *_FAR, *np.ones(7)]),
}
"""No number that is seen is larger."""


def insert_space(pixels: bool) -> spaces.Dict:
    """The space of what is seen."""
    seen: dict[str, spaces.Space[Any]] = {
        name: spaces.Box(-most.astype(np.float32), most.astype(np.float32), dtype=np.float32)
        for name, most in _SEEN.items()
    }
    if pixels:
        seen["pixels"] = spaces.Box(0, 255, (PIXELS, PIXELS, 3), np.uint8)
    return spaces.Dict(seen)


def as_seen(
    control: TipControl, covariance: Array, best: float, left: int, action: NDArray[np.float32]
) -> dict[str, Any]:
    """What is seen now, but for pictures.

    Args:
        covariance: (6, 6), stated, of the twist of the part, [m, rad].
        best: The least that was left of the way in so far, [m].
        left: How many actions are left.
        action: (7,), the last one.
    """
    feel = control.feel
    way = (-1e3 * float(feel.tip[2]), 1e3 * best, PERIOD_S * left)
    seen: dict[str, Any] = {
        "agent_pos": [*feel.tip * MM_DEG, *feel.lag * MM_DEG, 1e3 * feel.opening],
        "wrench": feel.wrench,
        "plan": np.concatenate([control.start.way, way, control.sigmas(covariance) * MM_DEG, action]),
    }
    return {name: np.clip(seen[name], -most, most).astype(np.float32) for name, most in _SEEN.items()}
