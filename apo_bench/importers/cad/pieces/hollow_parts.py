"""Cut hollow free-form parts further until their hulls keep out of the free space around the solid, [mm].

Each part becomes its convex hull. Where the surface of the solid lies inside that hull, the hull fills free space that
other solids may need. So the part is cut at the deepest such point, repeatedly.
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
"""Depth of the surface inside a hull that is allowed where other solids come near."""
_FAR = 0.02
"""Depth that is allowed elsewhere, as a share of the size."""
_FLUSH_MM = 0.004
"""A point at a smaller depth lies on the hull."""
_NEAR_MM = 1.0
"""Distance within which other solids come near."""
_ALONE = 150  # pieces of a solid that is imported alone
_TOGETHER = 300  # pieces of a solid in an assembly
"""Limits on the number of pieces; if flat cuts alone give many, half the limit is added to their number."""
_AT_ONCE = 2_000_000
"""Distances that are computed at once, to limit the memory."""


class HollowSpace(NamedTuple):
    """The surroundings of a solid, which decide where its pieces must be exact."""

    size: float
    """Size of the solid."""
    flats: Array
    """Planes of its flat faces that other solids come near, (k, 4)."""
    others: Any = None
    """KD tree of the points of other solids that come near, at their places or on their paths; None: unknown."""

    def allowed_depth(self, points: Array, mesh: Mesh, planes: Array) -> Array:
        """Return the allowed depth of points of a part's surface, (k, 3), in its hull, (k,).

        Args:
            mesh: The part.
            planes: Planes of the hull.
        """
        is_near = self.is_near(points) | (len(points) > 0 and self._contains_other_points(mesh.corners, planes))
        return np.where(is_near, _DEEP_MM, max(_FAR * self.size, _DEEP_MM))

    def _contains_other_points(self, corners: Array, planes: Array) -> bool:
        """Whether points of other solids are inside the hull of corners, (k, 3)."""
        if self.others is None:
            return False
        points = self.others.data
        points = points[((points > corners.min(axis=0)) & (points < corners.max(axis=0))).all(axis=1)]
        return bool((measure_depths(points, planes) > _DEEP_MM).any())

    def is_near(self, points: Array) -> Any:
        """Return which points have other solids near, (k,); all if the others are unknown."""
        if self.others is None:
            return np.ones(len(points), dtype=bool)
        return np.isfinite(self.others.query(points, distance_upper_bound=_NEAR_MM)[0])


class _HullDeviation(NamedTuple):
    """The point at which a part deviates most from its hull."""

    share: float
    """Its depth over the allowed depth; 0 if no depth exceeds the allowed one."""
    point: Array
    normals: Array
    """Normals of the sides at the point, (k, 3)."""


def refine_pieces(parts: Iterable[CutPart], beside: HollowSpace, volume: float, hair: float) -> Iterator[CutPart]:
    """Cut parts further at their worst faults, the worst first, up to the largest number of pieces.

    Args:
        volume: Of the whole solid, [mm^3].
        hair: Distance of a cut from its plane, [mm].
    """
    ticket = count()  # breaks ties, as parts cannot be compared
    queue = [
        (-fault.share, next(ticket), part, fault) for part in parts for fault in [_find_worst_deviation(part, beside)]
    ]
    heapify(queue)
    done = 0
    most = _ALONE if beside.others is None else _TOGETHER
    most = max(most, len(queue) + most // 2)
    while queue:
        share, _, part, fault = heappop(queue)
        is_cut = share < 0.0 and done + len(queue) < most
        pieces = _cut_at_deviation(part, fault, SLIVER * volume, hair) if is_cut else [part]
        if len(pieces) < 2:
            done += 1
            yield part
            continue
        for each in pieces:
            fault = _find_worst_deviation(each, beside)
            heappush(queue, (-fault.share, next(ticket), each, fault))


def _find_worst_deviation(part: CutPart, beside: HollowSpace) -> _HullDeviation:
    """Return the worst fault of a part, over corners and middles of edges and sides."""
    mesh = convert_to_mesh(part.body)
    planes = _list_hull_planes(mesh.corners)
    middles = [mesh.corners[each].mean(axis=1) for each in (mesh.edges, mesh.triangles)]
    points = np.concatenate([mesh.corners, *middles])
    depth = measure_depths(points, planes) if len(planes) else np.zeros(len(points))
    points, depth = points[depth > _FLUSH_MM], depth[depth > _FLUSH_MM]
    share = depth / beside.allowed_depth(points, mesh, planes)
    if len(share) and share.max() > 1.0:
        k = int(share.argmax())
        return _HullDeviation(float(share[k]), points[k], _normals_at(mesh, points[k]))
    return _HullDeviation(0.0, mesh.corners[0], np.zeros((0, 3)))


def _normals_at(mesh: Mesh, point: Array) -> Array:
    """Return the normals of the sides at a corner, or at the middle of an edge or a side, (k, 3)."""
    sides = np.linalg.norm(mesh.corners[mesh.triangles] - point, axis=2).min(axis=1) < 1e-9
    edge = np.linalg.norm(mesh.corners[mesh.edges].mean(axis=1) - point, axis=1) < 1e-9
    sides[mesh.neighbours[edge].ravel()] = True
    sides |= np.linalg.norm(mesh.corners[mesh.triangles].mean(axis=1) - point, axis=1) < 1e-9
    length = np.linalg.norm(mesh.across, axis=1)
    sides &= length > 0.0
    return np.asarray(mesh.across[sides] / length[sides, None])


def _list_hull_planes(corners: Array) -> Array:
    """Return the planes n . x = d of the sides of a hull, without duplicates, (k, 4); none if the hull is flat."""
    try:
        planes = ConvexHull(corners).equations * [1.0, 1.0, 1.0, -1.0]
    except (QhullError, ValueError):
        return np.zeros((0, 4))
    return np.asarray(planes[np.unique(np.round(planes, 9), axis=0, return_index=True)[1]])


def _cut_at_deviation(part: CutPart, fault: _HullDeviation, least: float, hair: float) -> list[CutPart]:
    """Cut a part through its worst point along the plane whose halves have the least hull volume.

    Args:
        least: Smaller bodies are rounding, [mm^3].
        hair: Distance of a cut from its plane, [mm].
    """
    normals = fault.normals
    if len(normals) > 1:
        mean = normals.mean(axis=0)
        x, y = find_square_axes(mean / max(float(np.linalg.norm(mean)), 1e-12))
        _, first = np.unique(np.round(normals, 3), axis=0, return_index=True)
        # Candidate normals: those at the point, the axes of the frame, and planes that contain the mean normal.
        normals = np.array([*normals[np.sort(first)][:3], *np.eye(3), x, y, (x + y) / 2**0.5, (x - y) / 2**0.5])
    return cut_through(part, fault.point, normals, least, hair)


def measure_depths(points: Array, planes: Array) -> Array:
    """Return the depth of points, (k, 3), below the nearest plane of a hull, n . x = d, (p, 4); negative outside."""
    many = max(1, _AT_ONCE // max(len(planes), 1))
    chunks = [points[i : i + many] for i in range(0, len(points), many)]
    return np.concatenate([np.zeros(0), *((planes[:, 3] - each @ planes[:, :3].T).min(axis=1) for each in chunks)])
