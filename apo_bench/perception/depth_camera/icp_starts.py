"""Start poses of a fit: the poses of a part on a table whose bounding box matches that of the measured points."""

import numpy as np

from apo_bench.geometry import Array, list_quarter_turns

_EDGE_QUANTILE = 0.01
"""Fraction of the points ignored at either end of their extent, since noise makes regions larger than parts."""
_STEPS = 45
"""Number of directions, 0 to 90 degrees, that are tried for the sides of the smallest rectangle."""


def guess_poses(corners: Array, points: Array, same: Array) -> Array:
    """Start poses (s, 4, 4), world, [m], for the fit of a shape to measured points.

    The smallest rectangle around the points, in the top view, gives the rotation about the vertical. Of the 24
    orientations of a box, those that symmetries make equal are tried once. The shape is centred in the rectangle, with
    its top at the top of the points.

    Args:
        corners: (k, 3), of the shape, in its own frame, [m].
        points: (n, 3), world, [m].
        same: (m, 4, 4), symmetries of the shape.
    """
    turn = _find_least_rectangle(points[:, :2])
    c = np.cos(turn)
    s = np.sin(turn)
    Z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = np.quantile(points @ Z, (_EDGE_QUANTILE, 1.0 - _EDGE_QUANTILE), axis=0)
    turns = keep_distinct(list_quarter_turns(), same)
    T = np.tile(np.eye(4), (len(turns), 1, 1))
    for start, R in zip(T, turns, strict=True):
        turned = corners @ R.T
        a, b = turned.min(axis=0), turned.max(axis=0)
        start[:3, :3] = Z @ R
        start[:3, 3] = Z @ [*((low + high) / 2 - (a + b) / 2)[:2], high[2] - b[2]]
    return T


def keep_distinct(turns: Array, same: Array) -> Array:
    """Keep one rotation of each set that the symmetries make equal.

    Args:
        turns: (k, 3, 3).
        same: (m, 4, 4), symmetries of the shape.
    """
    kept: list[Array] = []
    for R in turns:
        if not any((np.abs(K @ same[:, :3, :3] - R).max(axis=(1, 2)) < 1e-9).any() for K in kept):
            kept.append(R)
    return np.array(kept)


def _find_least_rectangle(flat: Array) -> float:
    """The rotation of the rectangle of least area around points (n, 2), 0 to pi/2, [rad]."""
    turns = np.arange(_STEPS) * np.pi / 2 / _STEPS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    across = np.stack([-np.sin(turns), np.cos(turns)], axis=1)
    sizes = [
        np.ptp(np.quantile(flat @ w.T, (_EDGE_QUANTILE, 1.0 - _EDGE_QUANTILE), axis=0), axis=0) for w in (ways, across)
    ]
    return float(turns[np.argmin(sizes[0] * sizes[1])])
