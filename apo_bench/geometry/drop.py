"""How far a solid would fall before it meets another one."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import depths, upright
from apo_bench.geometry.solid import Solid

TOUCH_M = 1e-6
"""Deeper than this a solid is in another one, and no longer beside it."""
STEP_M = 5e-4
"""Half as thick as the thinnest pair of boxes that a fall may not pass unseen."""


def drop(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """How far `a` can go straight down until it meets `b`, to 2 um, [m]; infinite if it passes it by."""
    if not _above(a, T_a, b, T_b):
        return np.inf
    low, high = _span(a, T_a, b, T_b)
    for count in (int((high - low) / STEP_M) + 2, int(STEP_M / TOUCH_M) + 2):
        ways = np.linspace(low, high, count)
        met = np.flatnonzero(lowered(a, T_a, ways, b, T_b) > TOUCH_M)
        if not len(met):
            return np.inf
        low, high = float(ways[max(0, met[0] - 1)]), float(ways[met[0]])
    return low


def lowered(a: Solid, T_a: Array, ways: Array, b: Solid, T_b: Array) -> Array:
    """How deep `a` is in `b` once it went down so far, (k,), [m]; negative where they are apart."""
    at = T_a[:3, 3] - np.outer(ways, (0.0, 0.0, 1.0))
    return depths(a.boxes, T_a[:3, :3], at, b.boxes, T_b)


def _above(a: Solid, T_a: Array, b: Solid, T_b: Array) -> bool:
    """Whether the boxes around both, whose sides are those of the world, lie over one another in part."""
    (low_a, high_a), (low_b, high_b) = (upright(s.boxes, T[:3, :3], T[:3, 3]) for s, T in ((a, T_a), (b, T_b)))
    return bool((low_a[:2] < high_b[:2]).all() and (low_b[:2] < high_a[:2]).all() and low_b[2] < high_a[2])


def _span(a: Solid, T_a: Array, b: Solid, T_b: Array) -> tuple[float, float]:
    """From where on they may meet, and until where."""
    (low_a, high_a), (low_b, high_b) = (upright(s.boxes, T[:3, :3], T[:3, 3]) for s, T in ((a, T_a), (b, T_b)))
    return max(0.0, float(low_a[2] - high_b[2])), float(high_a[2] - low_b[2])
