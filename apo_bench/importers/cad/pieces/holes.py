"""Cut round holes out of convex pieces, as wedges that touch the wall of the hole from outside, [mm]."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import manifold3d
import numpy as np
from shapely import MultiPoint, Point

from apo_bench.geometry import Array, count_sides
from apo_bench.importers.cad.pieces.corners import is_thick, list_body_corners, list_hull_corners, merge_near_points
from apo_bench.importers.cad.solids import SAME_CORNER_MM, Region


def count_least_pieces(bores: Sequence[Region]) -> int:
    """Return the smallest number of wedges that surround round holes."""
    return sum(count_sides(1e-3 * max(bore.radii)) for bore in bores)


def bore_piece(corners: Array, bores: Sequence[Region], flats: Array, most: int) -> list[Array]:
    """Cut holes out of a convex piece, and return the corners of the convex pieces that remain, (k, 3) each.

    Args:
        corners: (k, 3), of the piece.
        flats: Planes of flat faces, (k, 4).
        most: Cutting stops once there are more pieces than this.
    """
    parts = [manifold3d.Manifold.hull_points(corners)]
    bores = [bore for bore in bores if _overlaps_hole(parts[0], bore)]
    if not bores:
        return [corners]
    # First cut halfway between parallel holes, so that wedges around one hole do not run into another.
    for a, b in combinations(bores, 2):
        plane = _find_plane_between(a, b)
        if plane is not None:
            parts = [
                half
                for part in parts
                for half in (
                    part.split_by_plane(*plane) if _overlaps_hole(part, a) and _overlaps_hole(part, b) else (part,)
                )
            ]
    for bore in bores:
        if len(parts) > most:
            break
        parts = [
            piece
            for part in parts
            for piece in (_cut_around_hole(part, bore) if _overlaps_hole(part, bore) else (part,))
        ]
    points = [merge_near_points(list_body_corners(part)) for part in parts if not part.is_empty()]
    return [list_hull_corners(each, flats) for each in points if len(each) >= 4 and is_thick(each)]


def _find_plane_between(a: Region, b: Region) -> tuple[Array, float] | None:
    """Return the plane n . x = d halfway between the walls of parallel holes; None for other or overlapping holes."""
    if np.linalg.norm(np.cross(a.direction, b.direction)) > 1e-6:
        return None
    off = b.point - a.point
    off = off - off @ a.direction * a.direction
    gap = float(np.linalg.norm(off))
    # Parallel axes: the plane is square to the shortest way between them, in the middle between the walls.
    room = gap - max(a.radii) - max(b.radii)
    return (off / gap, float(off / gap @ a.point + max(a.radii) + room / 2.0)) if room > 0.0 else None


def _overlaps_hole(part: Any, bore: Region) -> bool:
    """Whether a convex part overlaps a hole: in its range of heights, and seen along its axis."""
    if part.is_empty():
        return False
    low, high = np.array(part.bounding_box()).reshape(2, 3)
    if (low > bore.box[1]).any() or (high < bore.box[0]).any():
        return False
    corners = list_body_corners(part)
    height, _, _ = bore.polar(corners)
    if height.max() < bore.span[0] + SAME_CORNER_MM or height.min() > bore.span[1] - SAME_CORNER_MM:
        return False
    # Projected along the axis, a convex part is the hull of its corners, and the axis is the origin.
    flat = (corners - bore.point) @ np.column_stack(bore.across)
    return bool(MultiPoint(flat).convex_hull.distance(Point(0.0, 0.0)) < max(bore.radii) - SAME_CORNER_MM)


def _cut_around_hole(part: Any, bore: Region) -> Iterator[Any]:
    """Yield what remains of a convex part around a hole: parts above and below, and wedges that touch its wall."""
    axis = bore.direction
    x, y = bore.across
    foot = float(bore.point @ axis)
    above, rest = part.split_by_plane(axis, foot + bore.span[1])
    slab, below = rest.split_by_plane(axis, foot + bore.span[0])
    yield from (each for each in (above, below) if not each.is_empty())
    n = count_sides(1e-3 * max(bore.radii))
    slope = bore.slope if bore.kind == "cone" else 0.0
    at = bore.point + bore.span[0] * axis
    for i in range(n):
        # A wedge lies between half planes at angles a and b, and outside the plane that touches the wall at m between
        # them. The normal of that plane tilts against the axis by the slope of a cone.
        a, b, m = (2.0 * np.pi * (i + off) / n for off in (-0.5, 0.5, 0.0))
        right = -np.sin(a) * x + np.cos(a) * y
        left = np.sin(b) * x - np.cos(b) * y
        wall = np.cos(m) * x + np.sin(m) * y - slope * axis
        wedge = slab.trim_by_plane(right, float(right @ at)).trim_by_plane(left, float(left @ at))
        wedge = wedge.trim_by_plane(wall, float((wall @ at + bore.radii[0]) / np.linalg.norm(wall)))
        if not wedge.is_empty():
            yield wedge
