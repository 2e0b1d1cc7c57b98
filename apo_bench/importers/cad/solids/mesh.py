"""A triangle mesh and quantities that follow from it: edges, neighbours, volume."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from apo_bench.geometry import Array


@final
@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles that share corners, [mm]; most meshes are closed."""

    corners: Array
    """(k, 3), coordinates."""
    triangles: Any
    """(t, 3), indices of corners, counter-clockwise seen from outside."""

    @cached_property
    def across(self) -> Array:
        """Twice the area of each triangle as a vector along its normal, (t, 3)."""
        a, b, c = (self.corners[self.triangles[:, i]] for i in range(3))
        return np.asarray(np.cross(b - a, c - a))

    @cached_property
    def volume(self) -> float:
        """The enclosed volume, negative if normals point inwards, [mm^3]."""
        # Divergence theorem: the sum of the tetrahedra from one point to every triangle, a . (b - a) x (c - a) / 6.
        middle = self.corners.mean(axis=0)
        return float(((self.corners[self.triangles[:, 0]] - middle) * self.across).sum() / 6.0)

    @cached_property
    def extent(self) -> float:
        """The longest side of the axis-aligned bounding box, [mm]."""
        return float(np.ptp(self.corners[self.triangles.ravel()], axis=0).max()) if len(self.triangles) else 0.0

    @cached_property
    def sides(self) -> Any:
        """Directed edges of the triangles, (3 t, 2): from corner 0 to 1 of all triangles, then 1 to 2, then 2 to 0."""
        return np.concatenate([self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])

    @cached_property
    def twins(self) -> Any:
        """Pairs of rows of `sides` that are the same edge of a closed mesh, (e, 2)."""
        low, high = np.sort(self.sides, axis=1).T
        return np.lexsort((high, low)).reshape(-1, 2)

    @cached_property
    def neighbours(self) -> Any:
        """The two triangles at each edge of a closed mesh, (e, 2); the edge is directed as in the first."""
        return self.twins % len(self.triangles)

    @cached_property
    def edges(self) -> Any:
        """The two corners of each edge, (e, 2), in the order of `list_neighbours`."""
        return self.sides[self.twins[:, 0]]

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge has exactly two triangles."""
        counts = np.unique(np.sort(self.sides, axis=1), axis=0, return_counts=True)[1]
        return len(self.triangles) > 3 and bool((counts == 2).all())

    def part(self, triangles: Any) -> "Mesh":
        """Return the mesh of some triangles, with only the corners that they use, in the same order."""
        used, index = np.unique(self.triangles[triangles], return_inverse=True)
        return Mesh(self.corners[used], index.reshape(-1, 3))

    def flip(self) -> "Mesh":
        """Return the mesh with reversed orientation."""
        return Mesh(self.corners, self.triangles[:, ::-1])


def concatenate_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh of all triangles; corners of different meshes are not merged."""
    offsets = np.cumsum([0, *(len(mesh.corners) for mesh in meshes[:-1])])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.corners for mesh in meshes]), np.concatenate(triangles))


def find_connected_groups(pairs: Any, count: int) -> tuple[int, Any]:
    """Return the number of connected groups of 0 ... count - 1, and the group of each, (count,).

    Args:
        pairs: (p, 2), connected numbers.
    """
    return connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)
