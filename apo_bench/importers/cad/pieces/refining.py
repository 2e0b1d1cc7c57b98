"""Cut the parts of hollow free shapes on until their hulls keep out of the space around the solid, [mm].

A part becomes one piece, its convex hull. Where the surface of the solid lies inside of that hull, the hull fills free
space that other solids may need. So the part is cut through the deepest such point, again and again.
"""

from collections.abc import Iterable, Iterator
from heapq import heapify, heappop, heappush
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.cut_part import SLIVER, CutPart, cut_through
from apo_bench.importers.cad.solids import Mesh, convert_to_mesh, find_square_axes

_DEEP_MM = 0.02
"""How deep the surface may lie in a hull where other solids come near."""
_FAR = 0.005
"""How deep it may lie elsewhere, as a share of the size."""
_FLUSH_MM = 0.004
"""A point that is less deep lies on the hull."""
_NEAR_MM = 1.0
"""Other solids come near within this distance."""
_ALONE = 150
_TOGETHER = 300
"""The largest number of pieces of a solid alone, and of one among others; half as many more beyond its flat cuts."""
_AT_ONCE = 2_000_000
"""The number of distances that are computed together, which bounds the memory."""


class Beside(NamedTuple):
    """Where a solid must be exact."""

    size: float
    """Of the solid."""
    flats: Array
    """Planes of its flat faces, (k, 4)."""
    others: Any = None
    """A tree of points of other solids that come near, on their way and in their place; None: unknown."""

    def allowed_depth(self, points: Array, mesh: Mesh, planes: Array) -> Array:
        """Return how deep each point of the surface, (k, 3), of a part may lie in its hull, (k,).

        Args:
            planes: Of the hull.
        """
        is_near = self.is_near(points) | (len(points) > 0 and self._reaches(mesh.corners, planes))
        return np.where(is_near, _DEEP_MM, max(_FAR * self.size, _DEEP_MM))

    def _reaches(self, corners: Array, planes: Array) -> bool:
        """Whether others come into the hull of corners, (k, 3)."""
        if self.others is None:
            return False
        points = self.others.data
        points = points[((points > corners.min(axis=0)) & (points < corners.max(axis=0))).all(axis=1)]
        return bool((depths(points, planes) > _DEEP_MM).any())

    def is_near(self, points: Array) -> Any:
        """Return where others may come near, (k,)."""
        if self.others is None:
            return np.ones(len(points), dtype=bool)
        return np.isfinite(self.others.query(points, distance_upper_bound=_NEAR_MM)[0])


class _Fault(NamedTuple):
    """Where a part differs most from its hull."""

    share: float
    """Of the allowed depth; 0 if it is less."""
    point: Array
    normals: Array
    """Of the sides there, (k, 3)."""


def refine_pieces(parts: Iterable[CutPart], beside: Beside, volume: float, hair: float) -> Iterator[CutPart]:
    """Cut parts on where they are too hollow, the most hollow first, up to the largest number of pieces.

    Args:
        volume: Of the whole solid.
    """
    ticket = count()
    queue = [(-fault.share, next(ticket), part, fault) for part in parts for fault in [_worst_fault(part, beside)]]
    heapify(queue)
    done = 0
    most = _ALONE if beside.others is None else _TOGETHER
    most = max(most, len(queue) + most // 2)
    while queue:
        share, _, part, fault = heappop(queue)
        is_cut = share < 0.0 and done + len(queue) < most
        pieces = _cut_at(part, fault, SLIVER * volume, hair) if is_cut else [part]
        if len(pieces) < 2:
            done += 1
            yield part
            continue
        for each in pieces:
            fault = _worst_fault(each, beside)
            heappush(queue, (-fault.share, next(ticket), each, fault))


def _worst_fault(part: CutPart, beside: Beside) -> _Fault:
    mesh = convert_to_mesh(part.body)
    planes = _planes(mesh.corners)
    middles = [mesh.corners[each].mean(axis=1) for each in (mesh.edges, mesh.triangles)]
    points = np.concatenate([mesh.corners, *middles])
    depth = depths(points, planes) if len(planes) else np.zeros(len(points))
    points, depth = points[depth > _FLUSH_MM], depth[depth > _FLUSH_MM]
    share = depth / beside.allowed_depth(points, mesh, planes)
    if len(share) and share.max() > 1.0:
        k = int(share.argmax())
        return _Fault(float(share[k]), points[k], _normals_at(mesh, points[k]))
    return _Fault(0.0, mesh.corners[0], np.zeros((0, 3)))


def _normals_at(mesh: Mesh, point: Array) -> Array:
    """Normals of the sides at a corner, or at the middle of an edge or a side."""
    sides = np.linalg.norm(mesh.corners[mesh.triangles] - point, axis=2).min(axis=1) < 1e-9
    edge = np.linalg.norm(mesh.corners[mesh.edges].mean(axis=1) - point, axis=1) < 1e-9
    sides[mesh.neighbours[edge].ravel()] = True
    sides |= np.linalg.norm(mesh.corners[mesh.triangles].mean(axis=1) - point, axis=1) < 1e-9
    length = np.linalg.norm(mesh.across, axis=1)
    sides &= length > 0.0
    return np.asarray(mesh.across[sides] / length[sides, None])


def _planes(corners: Array) -> Array:
    """Planes of the sides of a hull, n . x = d, each once, (k, 4); none of a flat one."""
    try:
        planes = ConvexHull(corners).equations * [1.0, 1.0, 1.0, -1.0]
    except (QhullError, ValueError):
        return np.zeros((0, 4))
    return np.asarray(planes[np.unique(np.round(planes, 9), axis=0, return_index=True)[1]])


def _cut_at(part: CutPart, fault: _Fault, least: float, hair: float) -> list[CutPart]:
    """The part cut through its most hollow point along the plane that leaves the least hulls."""
    normals = fault.normals
    if len(normals) > 1:
        mean = normals.mean(axis=0)
        x, y = find_square_axes(mean / max(float(np.linalg.norm(mean)), 1e-12))
        _, first = np.unique(np.round(normals, 3), axis=0, return_index=True)
        normals = np.array([*normals[np.sort(first)][:3], *np.eye(3), x, y, (x + y) / 2**0.5, (x - y) / 2**0.5])
    return cut_through(part, fault.point, normals, least, hair)


def depths(points: Array, planes: Array) -> Array:
    """Return how deep points, (k, 3), are below the nearest plane n . x = d, (p, 4), of a hull; negative outside."""
    many = max(1, _AT_ONCE // max(len(planes), 1))
    chunks = [points[i : i + many] for i in range(0, len(points), many)]
    return np.concatenate([np.zeros(0), *((planes[:, 3] - each @ planes[:, :3].T).min(axis=1) for each in chunks)])
