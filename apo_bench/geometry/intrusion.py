"""How deep two solids of boxes are in each other."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Box, Solid


def intrusion(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """The depth of the deepest pair of boxes of two posed solids, [m]; 0 if they are apart or only touch.

    Separating axes: two boxes are apart if their shadows are apart along a normal of a side or along a cross product
    of two edges. The depth is the shortest way out.
    """
    centers_a, R_a, halves_a = _posed(a.boxes, T_a)
    centers_b, R_b, halves_b = _posed(b.boxes, T_b)
    axes = _axes(R_a, R_b)
    reach_a, reach_b = halves_a @ np.abs(axes @ R_a).T, halves_b @ np.abs(axes @ R_b).T
    apart = np.abs((centers_a[:, None] - centers_b[None]) @ axes.T)
    depth = (reach_a[:, None] + reach_b[None] - apart).min(axis=-1)
    return max(0.0, float(depth.max()))


def _posed(boxes: tuple[Box, ...], T: Array) -> tuple[Array, Array, Array]:
    """Centres (k, 3) in the world, the common rotation (3, 3), half sizes (k, 3)."""
    centers = np.array([box.center for box in boxes]) @ T[:3, :3].T + T[:3, 3]
    return centers, T[:3, :3], np.array([box.half for box in boxes])


def _axes(R_a: Array, R_b: Array) -> Array:
    """The directions along which two boxes may be apart, (k, 3), unit length; parallel edges give no cross product."""
    crossed = np.cross(R_a.T[:, None], R_b.T[None]).reshape(-1, 3)
    length = np.linalg.norm(crossed, axis=1)
    kept = length > 1e-6
    return np.concatenate([R_a.T, R_b.T, crossed[kept] / length[kept, None]])
