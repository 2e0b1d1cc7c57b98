"""How far a solid would fall before it meets another one."""

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import intrusion_depths, upright_bounds
from apo_bench.geometry.solid import Solid

TOUCH_M = 1e-6
"""Deeper than this a solid is in another one, and no longer beside it."""
_STEP_M = 5e-4
"""Places along a fall are so far apart: two boxes that together are thinner could pass each other unseen."""
_MOST_PLACES = 10_000
_AT_ONCE = 100_000
"""At most so many places, the farther apart; so many pairs of boxes are looked at together, which bounds the memory."""


def drop(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """How far `a` can go straight down until it meets `b`, to 2 um, [m]; infinite if it passes it by."""
    low_a, high_a = upright_bounds(a.pieces, T_a[:3, :3], T_a[:3, 3])
    low_b, high_b = upright_bounds(b.pieces, T_b[:3, :3], T_b[:3, 3])
    over = (low_a[:2] < high_b[:2]).all() and (low_b[:2] < high_a[:2]).all() and low_b[2] < high_a[2]
    if not over:
        return np.inf
    # Between the first and the last way at which the boxes around both may meet: first coarsely, then between the last
    # place without and the first place with a meeting.
    low = max(0.0, float(low_a[2] - high_b[2]))
    high = float(high_a[2] - low_b[2])
    for step in (_STEP_M, TOUCH_M):
        ways = np.linspace(low, high, min(int((high - low) / step) + 2, _MOST_PLACES))
        met = _first_met(a, T_a, ways, b, T_b)
        if met is None:
            return np.inf
        low = float(ways[max(0, met - 1)])
        high = float(ways[met])
    return low


def _first_met(a: Solid, T_a: Array, ways: Array, b: Solid, T_b: Array) -> int | None:
    """The first of the places at which `a` is in `b`."""
    count = max(1, _AT_ONCE // (len(a.pieces) * len(b.pieces)))
    for begin in range(0, len(ways), count):
        met = np.flatnonzero(drop_depths(a, T_a, ways[begin : begin + count], b, T_b) > TOUCH_M)
        if len(met):
            return begin + int(met[0])
    return None


def drop_depths(a: Solid, T_a: Array, ways: Array, b: Solid, T_b: Array) -> Array:
    """How deep `a` is in `b` once it went down so far, (k,), [m]; negative where they are apart."""
    at = T_a[:3, 3] - np.outer(ways, (0.0, 0.0, 1.0))
    return intrusion_depths(a.pieces, T_a[:3, :3], at, b.pieces, T_b)
