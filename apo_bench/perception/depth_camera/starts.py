"""Start poses of a fit: the ways in which a part that stands on a table may have the measured points."""

import numpy as np

from apo_bench.geometry import Array, list_quarter_turns

_EDGE = 0.01
"""Share of the points beyond either end of their extent: noise makes regions larger than parts."""
_STEPS = 45
"""Directions between 0 and 90 degrees that are tried for the sides of the smallest rectangle."""


def guess_poses(corners: Array, points: Array, same: Array) -> Array:
    """Poses (s, 4, 4) of a shape whose visible surface may be the points (n, 3), world, [m].

    The smallest rectangle around the points, seen from above, says how the sides of a part that stands on one of its
    sides are turned; of the 24 ways to put a box on a table those that look the same are tried once. The part is put in
    the middle of the rectangle, and as high as the points reach.

    Args:
        corners: (k, 3), of the shape, in its own frame.
        same: (m, 4, 4), displacements after which the shape looks the same.
    """
    turn = _find_sides(points[:, :2])
    c = np.cos(turn)
    s = np.sin(turn)
    Z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = np.quantile(points @ Z, (_EDGE, 1.0 - _EDGE), axis=0)
    turns = keep_distinct(list_quarter_turns(), same)
    T = np.tile(np.eye(4), (len(turns), 1, 1))
    for start, R in zip(T, turns, strict=True):
        turned = corners @ R.T
        a, b = turned.min(axis=0), turned.max(axis=0)
        start[:3, :3] = Z @ R
        start[:3, 3] = Z @ [*((low + high) / 2 - (a + b) / 2)[:2], high[2] - b[2]]
    return T


def keep_distinct(turns: Array, same: Array) -> Array:
    """Rotations without repetition: one, (3, 3), of each set in (k, 3, 3) that symmetries make equal."""
    kept: list[Array] = []
    for R in turns:
        if not any((np.abs(K @ same[:, :3, :3] - R).max(axis=(1, 2)) < 1e-9).any() for K in kept):
            kept.append(R)
    return np.array(kept)


def _find_sides(flat: Array) -> float:
    """The turn, 0 to 90 degrees, of the smallest rectangle around points (n, 2), [rad]."""
    turns = np.arange(_STEPS) * np.pi / 2 / _STEPS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    across = np.stack([-np.sin(turns), np.cos(turns)], axis=1)
    sizes = [np.ptp(np.quantile(flat @ w.T, (_EDGE, 1.0 - _EDGE), axis=0), axis=0) for w in (ways, across)]
    return float(turns[np.argmin(sizes[0] * sizes[1])])
