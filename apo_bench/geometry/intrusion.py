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
    return max(0.0, float(depths(a.boxes, T_a[:3, :3], T_a[None, :3, 3], b.boxes, T_b)[0]))


def depths(a: tuple[Box, ...], R_a: Array, at: Array, b: tuple[Box, ...], T_b: Array) -> Array:
    """As `intrusion`, of boxes that keep their orientation at k places; negative where they are apart.

    Args:
        R_a: (3, 3), the orientation of `a`.
        at: (k, 3), the places of the frame of `a`, [m].

    Returns:
        (k,), [m].
    """
    centers_a, halves_a = _boxes(a)
    centers_b, halves_b = _boxes(b)
    axes = _axes(R_a, T_b[:3, :3])
    reach = (halves_a @ np.abs(axes @ R_a).T)[:, None] + (halves_b @ np.abs(axes @ T_b[:3, :3]).T)[None]
    between = (centers_a @ R_a.T)[:, None] - (centers_b @ T_b[:3, :3].T + T_b[:3, 3])[None]
    apart = np.abs((between @ axes.T)[None] + (at @ axes.T)[:, None, None])
    return np.asarray((reach[None] - apart).min(axis=-1).max(axis=(1, 2)))


def _boxes(boxes: tuple[Box, ...]) -> tuple[Array, Array]:
    """Centres and half sizes, (k, 3) each, in the frame of their solid."""
    return np.array([box.center for box in boxes]), np.array([box.half for box in boxes])


def _axes(R_a: Array, R_b: Array) -> Array:
    """The directions along which two boxes may be apart, (k, 3), unit length; parallel edges give no cross product."""
    crossed = np.cross(R_a.T[:, None], R_b.T[None]).reshape(-1, 3)
    length = np.linalg.norm(crossed, axis=1)
    kept = length > 1e-6
    return np.concatenate([R_a.T, R_b.T, crossed[kept] / length[kept, None]])
