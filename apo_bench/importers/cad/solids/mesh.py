"""A triangle mesh and what follows from its triangles: sides, neighbours, volume."""

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
    """Triangles with common corners, [mm]; most meshes are closed."""

    corners: Array
    """(k, 3)."""
    triangles: Any
    """(t, 3), whole numbers, counter-clockwise seen from outside."""

    @cached_property
    def across(self) -> Array:
        """Twice the area of each triangle as a vector along its normal, (t, 3)."""
        a, b, c = (self.corners[self.triangles[:, i]] for i in range(3))
        return np.asarray(np.cross(b - a, c - a))

    @cached_property
    def volume(self) -> float:
        """Negative if it is inside out, [mm^3]."""
        # Divergence theorem: the sum of the tetrahedra from one point to every triangle, a . (b - a) x (c - a) / 6.
        middle = self.corners.mean(axis=0)
        return float(((self.corners[self.triangles[:, 0]] - middle) * self.across).sum() / 6.0)

    @cached_property
    def extent(self) -> float:
        """The longest side of the aligned box around it."""
        return float(np.ptp(self.corners[self.triangles.ravel()], axis=0).max()) if len(self.triangles) else 0.0

    @cached_property
    def sides(self) -> Any:
        """Directed edges of the triangles, (3 t, 2): those from corner 0 to 1 first, then 1 to 2, then 2 to 0."""
        return np.concatenate([self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])

    @cached_property
    def twins(self) -> Any:
        """Rows of `sides` that are one edge of a closed mesh, (e, 2)."""
        low, high = np.sort(self.sides, axis=1).T
        return np.lexsort((high, low)).reshape(-1, 2)

    @cached_property
    def neighbours(self) -> Any:
        """Pairs of triangles with a common edge, (e, 2), of a closed mesh; the edge is directed as in the first."""
        return self.twins % len(self.triangles)

    @cached_property
    def edges(self) -> Any:
        """The corners of these edges, (e, 2)."""
        return self.sides[self.twins[:, 0]]

    @cached_property
    def is_closed(self) -> bool:
        """Whether each edge has two triangles."""
        counts = np.unique(np.sort(self.sides, axis=1), axis=0, return_counts=True)[1]
        return len(self.triangles) > 3 and bool((counts == 2).all())

    def part(self, triangles: Any) -> "Mesh":
        """Return the mesh of some of the triangles, with the corners that they use, in their order."""
        used, index = np.unique(self.triangles[triangles], return_inverse=True)
        return Mesh(self.corners[used], index.reshape(-1, 3))

    def flip(self) -> "Mesh":
        """Return the mesh inside out."""
        return Mesh(self.corners, self.triangles[:, ::-1])


def concatenate_meshes(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh of all triangles; meshes share no corner."""
    offsets = np.cumsum([0, *(len(mesh.corners) for mesh in meshes[:-1])])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(np.concatenate([mesh.corners for mesh in meshes]), np.concatenate(triangles))


def find_connected_groups(pairs: Any, count: int) -> tuple[int, Any]:
    """Return how many groups pairs, (p, 2), make of 0 ... count - 1, and the group of each, (count,)."""
    return connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False)
