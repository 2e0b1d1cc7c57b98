"""How deep two solids of boxes are in each other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from apo_bench.geometry.arrays import Array, frozen
from apo_bench.geometry.solid import Box, Solid

_TOUCHING_M = 1e-6
"""Balls around solids are apart if this far from each other, whatever was rounded."""


def intrusion(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """The depth of the deepest pair of boxes of two posed solids, [m]; 0 if they are apart or only touch.

    Separating axes: two boxes are apart if their shadows are apart along a normal of a side or along a cross product
    of two edges. The depth is the shortest way out.
    """
    (middle_a, reach_a), (middle_b, reach_b) = _ball(a.boxes), _ball(b.boxes)
    between = T_a[:3, :3] @ middle_a + T_a[:3, 3] - T_b[:3, :3] @ middle_b - T_b[:3, 3]
    if between @ between > (reach_a + reach_b + _TOUCHING_M) ** 2:
        return 0.0
    return max(0.0, float(intrusion_depths(a.boxes, T_a[:3, :3], T_a[None, :3, 3], b.boxes, T_b)[0]))


def intrusion_depths(a: tuple[Box, ...], R_a: Array, at: Array, b: tuple[Box, ...], T_b: Array) -> Array:
    """How deep boxes that only shift are in others, at k places, (k,), [m]; negative where they are apart.

    Args:
        R_a: (3, 3), the orientation of `a`.
        at: (k, 3), the places of the frame of `a`, [m].

    Returns:
        (k,), [m].
    """
    (centers_a, halves_a), (centers_b, halves_b) = _boxes(a), _boxes(b)
    axes = _axes(R_a, T_b[:3, :3])
    reach = (halves_a @ np.abs(axes @ R_a).T)[:, None] + (halves_b @ np.abs(axes @ T_b[:3, :3]).T)[None]
    between = (centers_a @ R_a.T)[:, None] - (centers_b @ T_b[:3, :3].T + T_b[:3, 3])[None]
    apart = np.abs((between @ axes.T)[None] + (at @ axes.T)[:, None, None])
    return np.asarray((reach[None] - apart).min(axis=-1).max(axis=(1, 2)))


@lru_cache(maxsize=1024)
def _boxes(boxes: tuple[Box, ...]) -> tuple[Array, Array]:
    """Centres and half sizes, (k, 3) each, in the frame of their solid."""
    return frozen([box.center for box in boxes], None, 3), frozen([box.half for box in boxes], None, 3)


@lru_cache(maxsize=1024)
def _ball(boxes: tuple[Box, ...]) -> tuple[Array, float]:
    """Middle, (3,), and radius of a ball around boxes, in the frame of their solid."""
    centers, halves = _boxes(boxes)
    low, high = (centers - halves).min(axis=0), (centers + halves).max(axis=0)
    return frozen((low + high) / 2, 3), float(np.linalg.norm(high - low)) / 2


def _axes(R_a: Array, R_b: Array) -> Array:
    """The directions along which two boxes may be apart, (k, 3), unit length; parallel edges give no cross product."""
    a, b = R_a[:, :, None], R_b[:, None, :]
    crossed = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    crossed = crossed.reshape(3, -1).T
    length = np.sqrt((crossed * crossed).sum(axis=1))
    kept = length > 1e-6
    return np.concatenate([R_a.T, R_b.T, crossed[kept] / length[kept, None]])


def upright_bounds(boxes: tuple[Box, ...], R: Array, at: Array) -> tuple[Array, Array]:
    """The lowest and the highest corner, (3,) each, of the box around posed boxes whose sides are those of the world.

    Args:
        R: (3, 3), their orientation.
        at: (3,), the place of their frame, [m].
    """
    centers, halves = _boxes(boxes)
    middle, reach = centers @ R.T + at, halves @ np.abs(R).T
    return (middle - reach).min(axis=0), (middle + reach).max(axis=0)
