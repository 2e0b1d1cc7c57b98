"""Find the corners of convex pieces, without duplicates and within the limits on corners and sides, [mm]."""

from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from apo_bench.geometry import Array, Hull
from apo_bench.importers.cad.solids import SAME_CORNER_MM, find_square_axes

_MOST_CORNERS = 600  # corners of a piece
_MOST_SIDES = 300  # planes of its sides
_MOST_DIRECTIONS = 190  # edges
"""Limits of a piece; of a piece beyond them only the outermost corners are kept."""
_INSIDE_M = 5e-8
"""A point deeper inside a piece is no corner."""
_THIN_MM = 0.02
"""Thinner pieces are left out."""
_ON_MM = 2e-4  # corners this near to a plane lie in it
_DIGITS = 9
"""Decimals of corners in mm, as in part files."""
_NO_PLANES = np.zeros((0, 4))
_MOST_TRIED = 500  # sides of a hull whose thickness is measured
_IN_PLANE = (16, 8, 4)
"""Numbers of directions in a flat face whose outermost corners are kept first; the largest that fits is used."""
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
"""Directions in space whose outermost corners are kept first: the 26 neighbours of a cube."""
_AT_A_TIME = 3  # corners added to a reduced piece in each step
_LEFT_MM = 0.02
"""A reduced piece is good enough if no corner sticks out farther."""


def list_body_corners(body: Any) -> Array:
    """Return the corners of a manifold3d body, (k, 3)."""
    raw = body.to_mesh64()
    return np.asarray(raw.vert_properties)[np.unique(np.asarray(raw.tri_verts)), :3].astype(np.float64)


def list_hull_corners(points: Array, flats: Array, cuts: Array = _NO_PLANES) -> Array:
    """Return the corners of the convex hull of points, (k, 3); if there are too many, the outermost ones.

    Args:
        flats: Planes n . x = d of flat faces, (k, 4).
        cuts: Planes along which the piece was cut, (k, 4); a reduced piece keeps touching its neighbours if possible.
    """
    points = np.round(merge_near_points(points), _DIGITS)
    corners = points[np.sort(ConvexHull(points).vertices)]
    # Sides of a hull may differ by rounding only; a corner between two such sides then lies inside the merged plane.
    for _ in range(4):
        hull = Hull("", 1e-3 * corners)
        inside = (hull.planes[:, 3] - hull.corners @ hull.planes[:, :3].T).min(axis=1) > _INSIDE_M
        if not inside.any():
            break
        corners = corners[~inside]
    return np.asarray(corners) if _is_simple(corners) else _reduce_corners(corners, np.concatenate([flats, cuts]))


def _reduce_corners(corners: Array, planes: Array) -> Array:
    """Reduce the corners of a piece to the limits: keep the outermost, then add those that stick out most.

    Args:
        planes: Of flat faces and cuts, (k, 4), whose outlines are kept first.
    """
    for many in _IN_PLANE:
        kept = np.union1d(_find_outermost_on_flats(corners, planes, many), (corners @ _DIRECTIONS.T).argmax(axis=0))
        best = corners[kept]
        if _is_simple(best):
            break
    while _is_simple(corners[kept]):
        best = corners[kept]
        sides = ConvexHull(best).equations
        off = (corners @ sides[:, :3].T + sides[:, 3]).max(axis=1)
        if off.max() < _LEFT_MM:
            break
        kept = np.union1d(kept, np.argsort(-off)[:_AT_A_TIME])
    return np.asarray(best)


def _is_simple(corners: Array) -> bool:
    """Whether a piece is within the limits on corners, sides and edges."""
    hull = Hull("", 1e-3 * corners)
    return len(corners) <= _MOST_CORNERS and len(hull.planes) <= _MOST_SIDES and len(hull.edges) <= _MOST_DIRECTIONS


def _find_outermost_on_flats(corners: Array, flats: Array, many: int) -> Any:
    """Return the indices of the outermost corners in each flat face, in `many` directions each."""
    kept = [np.zeros(0, dtype=np.intp)]
    turn = 2.0 * np.pi * np.arange(many) / many
    for n, d in zip(flats[:, :3], flats[:, 3], strict=True):
        mine = np.flatnonzero(np.abs(corners @ n - d) < _ON_MM)
        if len(mine) >= 3:
            x, y = find_square_axes(n)
            way = np.outer(x, np.cos(turn)) + np.outer(y, np.sin(turn))
            kept.append(mine[(corners[mine] @ way).argmax(axis=0)])
    return np.unique(np.concatenate(kept))


def merge_near_points(points: Array) -> Array:
    """Return points without those near an earlier one."""
    return np.delete(points, [k for _, k in cKDTree(points).query_pairs(SAME_CORNER_MM)], axis=0)


def is_thick(points: Array) -> bool:
    """Whether the hull of points is thicker than a sheet."""
    try:
        planes = ConvexHull(points).equations
    except QhullError:
        return False
    # The width of a hull is least across a side, or between two edges, which is not tested. Only some sides are tested.
    planes = planes[:: -(-len(planes) // _MOST_TRIED)]
    depth = -(points @ planes[:, :3].T + planes[:, 3]).min(axis=0)
    return bool(depth.min() > _THIN_MM)
