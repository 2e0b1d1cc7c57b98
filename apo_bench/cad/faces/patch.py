"""A mesh whose corners are a little off its faces, or anywhere on them, and such faces, [mm]."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.faces.facets import edges_of, widest_of
from apo_bench.cad.faces.fitting import Round
from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.geometry import Array

_WEAK = 4.0
"""The normal of a triangle that is less high than so many distances says nothing."""
_MIDDLE = 0.2
"""Corners so far from both ends of a wall say whether it bends."""


class Plane(NamedTuple):
    """A flat surface."""

    normal: Array
    offset: float

    def off(self, points: Array) -> Array:
        """How far points are above it, (k,)."""
        return np.asarray(points @ self.normal - self.offset)


def normals_at(surface: Plane | Round, points: Array) -> Array:
    """Outward normals of a surface under points, (k, 3)."""
    return surface.normals(surface.polar(points)[2]) if isinstance(surface, Round) else surface.normal


class Patch(NamedTuple):
    """Triangles on one surface."""

    surface: Plane | Round | None
    """None: neither flat nor round."""
    triangles: Any
    hole: bool = False
    sides: int = 0
    """Of a whole turn of it; 0: that is not known."""


class Rough(NamedTuple):
    """A mesh and what is asked of it again and again."""

    mesh: Mesh
    near: float
    """How far corners may be off a face."""
    normals: Array
    weak: Any
    areas: Array
    middles: Array
    smooth: Any
    """Pairs of triangles, (s, 2)."""

    def points(self, triangles: Any) -> Array:
        return self.mesh.corners[np.unique(self.mesh.triangles[triangles])]


def rough_of(mesh: Mesh, near: float, fewest: int) -> Rough:
    """Normals of narrow triangles are those of the neighbours across their longest edges."""
    size = np.linalg.norm(mesh.across, axis=1)
    normals = mesh.across / np.maximum(size, 1e-300)[:, None]
    own, other, length, longest = edges_of(mesh)
    high = size / np.maximum(longest, 1e-300)
    weak = high < _WEAK * near
    take = weak[own] & (length > longest[own] * (1.0 - 1e-9)) & (high[other] > 1.5 * high[own])
    for _ in range(4):
        normals[own[take]] = normals[other[take]]
    i, k = mesh.neighbours.T
    smooth = mesh.neighbours[(normals[i] * normals[k]).sum(axis=1) > np.cos(widest_of(fewest))]
    middles = mesh.corners[mesh.triangles].mean(axis=1)
    return Rough(mesh, near, normals, weak, size / 2.0, middles, smooth)


def owner_of(rough: Rough, patches: Sequence[Patch]) -> Any:
    """The face of each triangle."""
    owner = np.full(len(rough.areas), -1)
    for k, patch in enumerate(patches):
        owner[patch.triangles] = k
    return owner


def bend_along(wall: Plane | Round | None, points: Array) -> tuple[float, float]:
    """How far corners bend off a wall from end to end, as those of a ball do, and what part of all they are off it.

    Nothing where they are at both ends only, and of what is no wall.
    """
    height = wall.polar(points)[0] if isinstance(wall, Round) else np.zeros(len(points))
    along = (height - height.mean()) / max(float(np.ptp(height)), 1e-300)
    if not ((along > along.min() + _MIDDLE) & (along < along.max() - _MIDDLE)).any():
        return 0.0, 0.0
    rows = np.column_stack([np.ones(len(along)), along, along**2])
    off = wall.off(points) if wall is not None else height
    straight, bent = (rows[:, :k] @ np.linalg.lstsq(rows[:, :k], off, rcond=1e-9)[0] for k in (2, 3))
    bend = bent - straight
    return float(np.ptp(bend)), float(bend @ bend / max(float((off - straight) @ (off - straight)), 1e-300))
