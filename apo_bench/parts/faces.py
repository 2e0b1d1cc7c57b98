"""The faces of a union of boxes: coplanar, edge-connected pieces of its surface."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.polygon import straightened
from apo_bench.geometry.solid import Box

SAME_PLANE_M = 1e-9
"""Sides of boxes this near to each other lie in one plane."""
SIDES = ("px", "nx", "py", "ny", "pz", "nz")
"""Outward direction of a face, in the order of faces in a solid; also the stem of automatic names."""


class Surface(NamedTuple):
    """One face without a name yet."""

    side: int
    """Index into `SIDES`."""
    height: float
    """Coordinate of its plane along its axis, [m]."""
    shape: Any
    """A shapely polygon in the two coordinates that follow the axis cyclically, [m]."""

    @property
    def axis(self) -> int:
        return self.side // 2

    @property
    def sign(self) -> int:
        return 1 - 2 * (self.side % 2)

    def flat(self, points: Array) -> Array:
        """The coordinates of points (k, 3) in the plane, (k, 2)."""
        return points[:, [(self.axis + 1) % 3, (self.axis + 2) % 3]]

    def rings(self) -> tuple[Array, ...]:
        """Outline, counter-clockwise seen from outside, then holes, clockwise; each (k, 3)."""
        from shapely.geometry.polygon import orient

        shape = orient(self.shape, self.sign)
        return tuple(self._lifted(ring) for ring in (shape.exterior, *shape.interiors))

    def _lifted(self, ring: Any) -> Array:
        flat = straightened(np.asarray(ring.coords)[:-1])
        first = np.lexsort(flat.T[::-1])[0]
        flat = np.roll(flat, -first, axis=0)
        out = np.empty((len(flat), 3))
        out[:, self.axis] = self.height
        out[:, (self.axis + 1) % 3], out[:, (self.axis + 2) % 3] = flat.T
        return out


class Union(NamedTuple):
    """The solid that boxes make together."""

    surfaces: tuple[Surface, ...]
    """In the order of `SIDES`, then by height, then by lowest corner."""
    centroid: Array
    volume: float
    pieces: int
    """How many solids hang together only loosely or not at all; 1 for a rigid part."""


def unite(boxes: Sequence[Box]) -> Union:
    """The union of boxes as a solid with flat faces; coordinates are those of the boxes, exactly.

    The union is made on the grid of all sides of all boxes, in whole numbers, which no rounding touches.
    """
    import trimesh

    grid = [_planes(boxes, axis) for axis in range(3)]
    solids = [trimesh.creation.box(bounds=_ranks(box, grid)) for box in boxes]
    mesh = trimesh.boolean.union(solids, engine="manifold") if len(solids) > 1 else solids[0]
    triangles = _off_grid(np.asarray(mesh.vertices), grid)[np.asarray(mesh.faces)]
    volume, centroid = _content(triangles)
    return Union(_surfaces(triangles), centroid, volume, int(mesh.body_count))


def _planes(boxes: Sequence[Box], axis: int) -> Array:
    """The coordinates of all sides along an axis, ascending, each once."""
    sides = np.sort([box.center[axis] + sign * box.half[axis] for box in boxes for sign in (-1, 1)])
    return np.round(sides[np.diff(sides, prepend=-np.inf) > SAME_PLANE_M], 12)


def _ranks(box: Box, grid: Sequence[Array]) -> Array:
    """The box on the grid: ranks of its lowest and highest corner, (2, 3)."""
    corners = (box.center - box.half, box.center + box.half)
    return np.array([[np.abs(g - x).argmin() for g, x in zip(grid, corner, strict=True)] for corner in corners], float)


def _off_grid(corners: Array, grid: Sequence[Array]) -> Array:
    """Points on the grid (k, 3) as points of the part, [m]; only points inside faces and edges have broken ranks."""
    whole = np.rint(corners)
    ranks = np.where(np.abs(corners - whole) < 1e-4, whole, corners)
    return np.column_stack([np.interp(r, np.arange(len(g)), g) for r, g in zip(ranks.T, grid, strict=True)])


def _content(triangles: Array) -> tuple[float, Array]:
    """Volume [m^3] and centre of volume (3,) inside a closed surface (k, 3, 3), by tetrahedra from one corner."""
    edges = triangles - triangles[0, 0]
    volumes = np.einsum("ki,ki->k", np.cross(edges[:, 0], edges[:, 1]), edges[:, 2]) / 6
    volume = float(volumes.sum())
    return volume, triangles[0, 0] + volumes @ edges.sum(axis=1) / 4 / volume


def _surfaces(triangles: Array) -> tuple[Surface, ...]:
    """Triangles (k, 3, 3) gathered by plane; what hangs together over edges is one face."""
    from shapely import Polygon, unary_union

    planes: dict[tuple[int, float], list[Any]] = defaultdict(list)
    for triangle in triangles:
        n = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        axis = int(np.abs(n).argmax())
        key = 2 * axis + int(n[axis] < 0), float(triangle[0, axis])
        flat = Polygon(triangle[:, [(axis + 1) % 3, (axis + 2) % 3]])
        if flat.area > 0:
            planes[key].append(flat)
    found = []
    for (side, height), flats in planes.items():
        joined = unary_union(flats)
        found += [Surface(side, height, piece) for piece in getattr(joined, "geoms", (joined,))]
    return tuple(sorted(found, key=lambda s: (s.side, s.height, s.shape.bounds)))
