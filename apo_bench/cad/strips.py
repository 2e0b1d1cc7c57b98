"""Walls between two circles, or a circle and a tip, as strips from end to end."""

from typing import Any

import numpy as np

from apo_bench.cad.fitting import Round
from apo_bench.cad.raw import Mesh
from apo_bench.cad.round_region import border_of
from apo_bench.geometry.arrays import Array

_LEVEL = 1e-6
_SAME_RAD = 1e-5
_FEWEST = 6
"""Corners of an end are level within this part of the size, and lie at one angle with those of the other end."""


def wall_strips(mesh: Mesh, triangles: Any, surface: Round) -> Any:
    """Other triangles, (s, 3), for some of a mesh, with the same border and no corner inside of it.

    None: its ends are not two level circles with corners at the same angles, nor one and a tip.
    """
    near = _LEVEL * mesh.extent
    x = np.eye(3)[int(np.abs(surface.axis).argmin())]
    x = x - (x @ surface.axis) * surface.axis
    x /= np.linalg.norm(x)
    every = np.unique(mesh.triangles[triangles])
    height, distance, out = surface.polar(mesh.corners[every])
    angle = np.arctan2(out @ np.cross(surface.axis, x), out @ x)
    tip = distance < near
    ends = []
    on = np.isin(every, border_of(mesh, triangles)) | tip
    for end in (height.min(), height.max()):
        mine = on & (np.abs(height - end) < near)
        on = on & ~mine
        order = np.argsort(angle[mine])
        ends.append((every[mine][order], angle[mine][order]))
    if on.any() or tip.sum() > 1:
        return None
    (low, a), (high, b) = ends
    if not tip.any() and not (len(low) == len(high) >= _FEWEST and _at_one_angle(a, b)):
        return None
    if tip.any() and sorted((len(low) == 1, len(high) == 1)) != [False, True]:
        return None
    strips = _between(low, high)
    points = mesh.corners[strips]
    outward = (np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]) * _out(surface, points)).sum()
    before = (mesh.across[triangles] * _out(surface, mesh.corners[mesh.triangles[triangles]])).sum()
    return strips if outward * before > 0.0 else strips[:, ::-1]


def _at_one_angle(a: Array, b: Array) -> bool:
    off = np.abs(a - b)
    return bool(np.minimum(off, 2.0 * np.pi - off).max() < _SAME_RAD)


def _between(low: Any, high: Any) -> Any:
    after = np.roll(low, -1), np.roll(high, -1)
    if len(high) == 1:
        return np.column_stack([low, after[0], np.full(len(low), high[0])])
    if len(low) == 1:
        return np.column_stack([np.full(len(high), low[0]), after[1], high])
    return np.concatenate([np.column_stack([low, after[0], after[1]]), np.column_stack([low, after[1], high])])


def _out(surface: Round, points: Array) -> Array:
    """The way from the axis at the middle of each triangle (t, 3, 3)."""
    return surface.polar(points.mean(axis=1))[2]
