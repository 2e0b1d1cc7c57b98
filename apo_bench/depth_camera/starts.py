"""Where a fit may begin: every way up, turned and shifted as the region of the points says."""

import numpy as np

from apo_bench.depth_camera.distance import Shape
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.symmetry import quarter_turns

_EDGE = 0.01
"""Share of the points beyond either end of their extent: noise makes regions larger than parts."""
_STEPS = 45
"""Directions between 0 and 90 degrees that are tried for the sides of the smallest rectangle."""


def starts(shape: Shape, points: Array, same: Array) -> Array:
    """Poses (s, 4, 4) of a shape whose visible surface may be the points (n, 3), world, [m].

    The smallest rectangle around the points, seen from above, says how the sides of a part that stands on one of its
    sides are turned; of the 24 ways to put a box on a table those that look alike are tried once. The part is put in
    the middle of the rectangle, and as high as the points reach.

    Args:
        same: (m, 4, 4), displacements after which the shape looks the same.
    """
    turn = _sides(points[:, :2])
    c = np.cos(turn)
    s = np.sin(turn)
    Z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    low, high = _extent(points @ Z)
    found = []
    for R in distinct(quarter_turns(), same):
        a, b = turned_bounds(shape, R)
        at = np.array([*((low + high) / 2 - (a + b) / 2)[:2], high[2] - b[2]])
        T = np.eye(4)
        T[:3, :3] = Z @ R
        T[:3, 3] = Z @ at
        found.append(T)
    return np.array(found)


def distinct(turns: Array, same: Array) -> Array:
    """Rotations without repetition: one, (3, 3), of each set in (k, 3, 3) that symmetries make alike."""
    kept: list[Array] = []
    for R in turns:
        if not any((np.abs(K @ same[:, :3, :3] - R).max(axis=(1, 2)) < 1e-9).any() for K in kept):
            kept.append(R)
    return np.array(kept)


def turned_bounds(shape: Shape, R: Array) -> tuple[Array, Array]:
    """The lowest and the highest corner of the turned shape, (3,) each, [m]."""
    centers = shape.center @ R.T
    reach = np.einsum("kij,kj->ki", np.abs(R @ shape.turn), shape.half)
    return (centers - reach).min(axis=0), (centers + reach).max(axis=0)


def _extent(points: Array) -> tuple[Array, Array]:
    low, high = np.quantile(points, (_EDGE, 1.0 - _EDGE), axis=0)
    return low, high


def _sides(flat: Array) -> float:
    """The turn, 0 to 90 degrees, of the smallest rectangle around points (n, 2), [rad]."""
    turns = np.arange(_STEPS) * np.pi / 2 / _STEPS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    across = np.stack([-np.sin(turns), np.cos(turns)], axis=1)
    sizes = [np.ptp(np.quantile(flat @ w.T, (_EDGE, 1.0 - _EDGE), axis=0), axis=0) for w in (ways, across)]
    return float(turns[np.argmin(sizes[0] * sizes[1])])
