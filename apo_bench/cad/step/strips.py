"""Walls between two circles, or a circle and a tip, as strips from end to end."""

from typing import Any

import numpy as np

from apo_bench.cad.faces.fitting import Round, border_of
from apo_bench.cad.solids.raw_solid import Mesh, square_to
from apo_bench.geometry import Array

_LEVEL = 1e-6
_SAME_RAD = 1e-5
_FEWEST = 6
"""Corners of an end are level within this part of the size, and lie at one angle with those of the other end."""


def wall_strips(mesh: Mesh, triangles: Any, surface: Round) -> Any:
    """Other triangles, (s, 3), for some of a mesh, with the same border and no corner inside of it.

    None: its ends are not two level circles with corners at the same angles, nor one and a tip.
    """
    near = _LEVEL * mesh.extent
    x, y = square_to(surface.axis)
    every = np.unique(mesh.triangles[triangles])
    height, distance, out = surface.polar(mesh.corners[every])
    angle = np.arctan2(out @ y, out @ x)
    tip = distance < near
    # Corners of the border, and a tip, at either end, in their order around the axis.
    left = np.isin(every, border_of(mesh, triangles)) | tip
    ends = []
    for end in (height.min(), height.max()):
        mine = np.flatnonzero(left & (np.abs(height - end) < near))
        left[mine] = False
        ends.append(mine[np.argsort(angle[mine])])
    if left.any():
        return None
    low, high = ends
    if tip.any() and (len(low) == 1) == (len(high) == 1):
        return None
    if not tip.any() and not (len(low) == len(high) >= _FEWEST and _are_at_one_angle(angle[low], angle[high])):
        return None
    strips = _between(every[low], every[high])
    # They look the way that the triangles did: outwards, or towards the axis for a hole.
    points = mesh.corners[strips]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    outward = (normals * _out(surface, points)).sum()
    before = (mesh.across[triangles] * _out(surface, mesh.corners[mesh.triangles[triangles]])).sum()
    return strips if outward * before > 0.0 else strips[:, ::-1]


def _are_at_one_angle(a: Array, b: Array) -> bool:
    off = np.abs(a - b)
    return bool(np.minimum(off, 2.0 * np.pi - off).max() < _SAME_RAD)


def _between(low: Any, high: Any) -> Any:
    """Triangles between two rings of corners, or a ring and a tip."""
    low_next = np.roll(low, -1)
    high_next = np.roll(high, -1)
    if len(high) == 1:
        return np.column_stack([low, low_next, np.full(len(low), high[0])])
    if len(low) == 1:
        return np.column_stack([np.full(len(high), low[0]), high_next, high])
    return np.concatenate([np.column_stack([low, low_next, high_next]), np.column_stack([low, high_next, high])])


def _out(surface: Round, points: Array) -> Array:
    """The way from the axis at the middle of each triangle (t, 3, 3)."""
    return surface.polar(points.mean(axis=1))[2]
