"""Parts of a solid that stand for hollow free shapes, cut on until they keep out of the space beside the solid, [mm].

A part becomes one piece, its convex hull. Where the surface of the solid lies inside of that hull, the hull fills space
that is free, and others may pass there. So the part is cut through the deepest such point, again and again; what is
left then is taken off the sides that bridge it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import count
from typing import Any, NamedTuple, final

import manifold3d
import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError, cKDTree

from apo_bench.geometry import Array
from apo_bench.importers.cad.pieces.corners import LEFT_MM, is_thick, reduced
from apo_bench.importers.cad.pieces.cut_part import SLIVER, CutPart, cut_through
from apo_bench.importers.cad.solids.bodies import mesh_of
from apo_bench.importers.cad.solids.mesh import Mesh
from apo_bench.importers.cad.solids.region import square_to

_DEEP_MM = 0.04
_FAR = 0.005
"""How deep the surface may lie in a hull that is not cut on, where others come by; elsewhere, as a part of the size."""
_INSIDE_MM = 0.004
"""Less deep it counts as flush."""
_BESIDE_MM = 1.0
"""Others come by if they come so near."""
_PLANES = 6
_ALONE = 150
_TOGETHER = 300
"""Pieces up to which parts are cut on, of a part alone and of one with others beside it; half as many more where flat
faces alone took more."""
_MOST_LOST = 0.05
_MOST_SPARE = 4.0
"""Of a part so much may be taken away, or so many times what its hull fills beyond it."""
_SAME = 1e-3
"""Planes are one if normals and offsets, [mm], differ by less."""
_AT_ONCE = 2_000_000
"""Distances that are computed together, which bounds the memory."""


@final
@dataclass(frozen=True, eq=False)
class Beside:
    """Where a solid need be exact."""

    size: float
    """Of the solid."""
    flats: Array
    """Planes of its flat faces, (k, 4)."""
    others: Any = None
    """A tree of points of what comes near to it, on its way and in its place; None: nothing is known of others."""
    trims: bool = True
    """Whether what sticks out of the solid is taken off its hulls."""

    @property
    def most(self) -> int:
        return _ALONE if self.others is None else _TOGETHER

    def allowed(self, points: Array, mesh: Mesh, hull: Array) -> Array:
        """How deep each point of the surface, (k, 3), of a part may lie in its hull, which has these planes, (k,)."""
        # A hull that bridges a hollow may reach others that are not near to the bottom of it.
        is_near = self.near(points) | (len(points) > 0 and self._reached(mesh.corners, hull))
        return np.where(is_near, _DEEP_MM, max(_FAR * self.size, _DEEP_MM))

    def _reached(self, corners: Array, hull: Array) -> bool:
        """Whether others come into the hull of corners, (k, 3)."""
        if self.others is None:
            return False
        others = self.others.data
        inside = others[((others > corners.min(axis=0)) & (others < corners.max(axis=0))).all(axis=1)]
        for first in range(0, len(hull), _PLANES):  # a few at a time, since few points are left after the first ones
            inside = inside[depths(inside, hull[first : first + _PLANES]) > _DEEP_MM]
        return len(inside) > 0

    def near(self, points: Array) -> Any:
        """Where others may come by, (k,)."""
        if self.others is None:
            return np.ones(len(points), dtype=bool)
        return np.isfinite(self.others.query(points, distance_upper_bound=_BESIDE_MM)[0])


class _Worst(NamedTuple):
    """Where a part is most hollow."""

    share: float
    """Of the depth that is allowed; 0 if less is there."""
    point: Array
    normals: Array
    """Of the sides there, (k, 3), or of planes that halve a part that needs too many corners."""


def refined(parts: Iterable[CutPart], beside: Beside, volume: float, hair: float) -> Iterator[CutPart]:
    """Parts that are cut on where they are too hollow, the most hollow first, as long as there are not too many.

    Args:
        volume: Of the whole solid.
    """
    ticket = count()
    queue = [(-worst.share, next(ticket), part, worst) for part in parts for worst in [_worst(part, beside)]]
    heapify(queue)
    done = 0
    most = max(beside.most, len(queue) + beside.most // 2)
    while queue:
        share, _, part, worst = heappop(queue)
        more = share < 0.0 and done + len(queue) < most
        pieces = _best(part, worst, SLIVER * volume, hair) if more else [part]
        if len(pieces) < 2:
            done += 1
            yield _within(part, beside) if beside.trims else part
        else:
            for each in pieces:
                worst = _worst(each, beside)
                heappush(queue, (-worst.share, next(ticket), each, worst))


def _worst(part: CutPart, beside: Beside) -> _Worst:
    mesh = mesh_of(part.body)
    points, depth, planes = _hollow(mesh)
    share = depth / beside.allowed(points, mesh, planes)
    if len(share) and share.max() > 1.0:
        k = int(share.argmax())
        # The sides at that corner or edge, or the one around that middle, as far as they have a normal.
        sides = np.linalg.norm(mesh.corners[mesh.triangles] - points[k], axis=2).min(axis=1) < 1e-9
        edge = np.linalg.norm(mesh.corners[mesh.edges].mean(axis=1) - points[k], axis=1) < 1e-9
        sides[mesh.neighbours[edge].ravel()] = True
        sides |= np.linalg.norm(mesh.corners[mesh.triangles].mean(axis=1) - points[k], axis=1) < 1e-9
        length = np.linalg.norm(mesh.across, axis=1)
        normals = mesh.across[sides & (length > 0.0)] / length[sides & (length > 0.0), None]
        return _Worst(float(share[k]), points[k], normals)
    # What is thinner than a sheet is left out later.
    if beside.others is not None and not len(points) and is_thick(mesh.corners):
        off = -depths(mesh.corners, _planes(reduced(mesh.corners, beside.flats, part.planes)))
        lost = mesh.corners[off > LEFT_MM]
        if beside.near(lost).any():
            low, high = mesh.corners.min(axis=0), mesh.corners.max(axis=0)
            axis = np.eye(3)[int((high - low).argmax())]
            return _Worst(1.0 + float(off.max()), (low + high) / 2.0, axis[None])
    return _Worst(0.0, mesh.corners[0], np.zeros((0, 3)))


def _hollow(mesh: Mesh) -> tuple[Array, Array, Array]:
    """Where corners and middles of edges and sides lie inside of the hull, (k, 3); how deep; planes of the hull."""
    planes = _planes(mesh.corners)
    middles = [mesh.corners[each].mean(axis=1) for each in (mesh.edges, mesh.triangles)]
    points = np.concatenate([mesh.corners, *middles])
    depth = depths(points, planes) if len(planes) else np.zeros(len(points))
    return points[depth > _INSIDE_MM], depth[depth > _INSIDE_MM], planes


def _planes(corners: Array) -> Array:
    """Of the sides of a hull, n . x = d, each once, (k, 4); none of what is flat."""
    try:
        planes = ConvexHull(corners).equations * [1.0, 1.0, 1.0, -1.0]
    except (QhullError, ValueError):
        return np.zeros((0, 4))
    return np.asarray(planes[np.unique(np.round(planes, 9), axis=0, return_index=True)[1]])


def _best(part: CutPart, worst: _Worst, least: float, hair: float) -> list[CutPart]:
    """The part cut through its most hollow point along the plane that leaves the least hulls."""
    normals = worst.normals
    if len(normals) > 1:
        mean = normals.mean(axis=0)
        x, y = square_to(mean / max(float(np.linalg.norm(mean)), 1e-12))
        _, first = np.unique(np.round(normals, 3), axis=0, return_index=True)
        normals = np.array([*normals[np.sort(first)][:3], *np.eye(3), x, y, (x + y) / 2**0.5, (x - y) / 2**0.5])
    return cut_through(part, worst.point, normals, least, hair)


def _within(part: CutPart, beside: Beside) -> CutPart:
    """The hull of a part less what its free sides bridge of hollows, unless too much of the part would go with it."""
    corners = mesh_of(part.body).corners
    hollow, _, planes = _hollow(mesh_of(part.body))
    # Flat faces and cuts stay where they are, whichever way they look.
    known = np.concatenate([beside.flats, part.planes, -part.planes])
    free = np.flatnonzero(np.isinf(cKDTree(known).query(planes, distance_upper_bound=_SAME)[0]))
    if not len(hollow) or not len(free):
        return part
    below = planes[free, 3] - hollow @ planes[free, :3].T
    taken = np.zeros(len(free))
    np.maximum.at(taken, below.argmin(axis=1), below.min(axis=1))
    planes[free, 3] -= taken
    body = part.body.hull()
    spare = body.volume() - part.body.volume()
    middle = corners.mean(axis=0)
    if depths(middle[None], planes)[0] > _INSIDE_MM:
        inside = HalfspaceIntersection(planes * [1.0, 1.0, 1.0, -1.0], middle).intersections
        body = manifold3d.Manifold.hull_points(inside)
    else:
        for *n, d in planes[free[taken > 0.0]]:
            body = body.trim_by_plane(-np.array(n), -d)
    is_much = (part.body - body).volume() > max(_MOST_LOST * part.body.volume(), _MOST_SPARE * spare)
    return part if is_much else CutPart(body, part.planes)


def depths(points: Array, planes: Array) -> Array:
    """How deep points, (k, 3), are below the nearest of the planes n . x = d of a convex piece, (p, 4); negative above
    one of them."""
    many = max(1, _AT_ONCE // max(len(planes), 1))
    chunks = [points[i : i + many] for i in range(0, len(points), many)]
    return np.concatenate([np.zeros(0), *((planes[:, 3] - each @ planes[:, :3].T).min(axis=1) for each in chunks)])
