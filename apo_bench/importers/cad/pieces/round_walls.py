"""Round walls of pieces, [mm].

Holes are filled before a solid is cut, then cut out of its pieces as wedges that touch the wall. Pieces of shafts get
as many corners around the axis as the wall needs, or are true cylinders.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import manifold3d
import numpy as np
from scipy.spatial import ConvexHull
from shapely import MultiPoint, Point

from apo_bench.geometry import Array, Cylinder, Hull, cylinder_hull, sides_of
from apo_bench.importers.cad.pieces.corners import corners_of, hull_corners, is_thick, merge_near_points
from apo_bench.importers.cad.solids import SAME_CORNER_MM, Region
from apo_bench.scenario.parts.allowed import THINNEST_M, WIDEST_M

_WIDER = 1.6
"""A gap between corners of a ring that is wider than most by this factor belongs to no wall."""


def least_pieces(bores: Sequence[Region]) -> int:
    """Return the smallest number of wedges around round holes."""
    return sum(sides_of(1e-3 * max(bore.radii)) for bore in bores)


def bore_piece(corners: Array, bores: Sequence[Region], flats: Array, most: int) -> list[Array]:
    """A convex piece less round holes, as convex pieces; no more holes are taken out when there are too many pieces.

    Args:
        most: Pieces that are allowed.
    """
    parts = [manifold3d.Manifold.hull_points(corners)]
    bores = [bore for bore in bores if _meets(parts[0], bore)]
    if not bores:
        return [corners]
    # First halfway between holes side by side, so that wedges around one do not run through the other one.
    for a, b in combinations(bores, 2):
        plane = _between(a, b)
        if plane is not None:
            parts = [
                half
                for part in parts
                for half in (part.split_by_plane(*plane) if _meets(part, a) and _meets(part, b) else (part,))
            ]
    for bore in bores:
        if len(parts) > most:
            break
        parts = [piece for part in parts for piece in (_around(part, bore) if _meets(part, bore) else (part,))]
    points = [merge_near_points(corners_of(part)) for part in parts if not part.is_empty()]
    return [hull_corners(each, flats) for each in points if len(each) >= 4 and is_thick(each)]


def _between(a: Region, b: Region) -> tuple[Array, float] | None:
    """The plane n . x = d between two holes side by side."""
    if np.linalg.norm(np.cross(a.direction, b.direction)) > 1e-6:
        return None
    off = b.point - a.point
    off = off - off @ a.direction * a.direction
    gap = float(np.linalg.norm(off))
    # Parallel axes: the plane is square to the shortest way between them, in the middle of what is left between walls.
    room = gap - max(a.radii) - max(b.radii)
    return (off / gap, float(off / gap @ a.point + max(a.radii) + room / 2.0)) if room > 0.0 else None


def _meets(part: Any, bore: Region) -> bool:
    """Whether a part, seen along the axis of a hole, comes near to the hole."""
    if part.is_empty():
        return False
    low, high = np.array(part.bounding_box()).reshape(2, 3)
    if (low > bore.box[1]).any() or (high < bore.box[0]).any():
        return False
    corners = corners_of(part)
    height, _, _ = bore.polar(corners)
    if height.max() < bore.span[0] + SAME_CORNER_MM or height.min() > bore.span[1] - SAME_CORNER_MM:
        return False
    # Seen along the axis a convex part is the hull of its corners, and the axis is the origin.
    flat = (corners - bore.point) @ np.column_stack(bore.across)
    return bool(MultiPoint(flat).convex_hull.distance(Point(0.0, 0.0)) < max(bore.radii) - SAME_CORNER_MM)


def _around(part: Any, bore: Region) -> Iterator[Any]:
    """A convex part less a round hole: what is below and above it, and wedges that touch its wall from outside."""
    axis = bore.direction
    x, y = bore.across
    foot = float(bore.point @ axis)
    above, rest = part.split_by_plane(axis, foot + bore.span[1])
    slab, below = rest.split_by_plane(axis, foot + bore.span[0])
    yield from (each for each in (above, below) if not each.is_empty())
    n = sides_of(1e-3 * max(bore.radii))
    slope = bore.slope if bore.kind == "cone" else 0.0
    at = bore.point + bore.span[0] * axis
    for i in range(n):
        # A wedge lies between the half planes at angles a and b, and beyond the plane that touches the wall at m
        # between them: its normal leans back against the axis by the slope of a cone.
        a, b, m = (2.0 * np.pi * (i + off) / n for off in (-0.5, 0.5, 0.0))
        right = -np.sin(a) * x + np.cos(a) * y
        left = np.sin(b) * x - np.cos(b) * y
        wall = np.cos(m) * x + np.sin(m) * y - slope * axis
        wedge = slab.trim_by_plane(right, float(right @ at)).trim_by_plane(left, float(left @ at))
        wedge = wedge.trim_by_plane(wall, float((wall @ at + bore.radii[0]) / np.linalg.norm(wall)))
        if not wedge.is_empty():
            yield wedge


def round_shafts(corners: Array, shafts: Sequence[Region]) -> Array:
    """A piece with as many corners on a shaft as its wall needs: new ones on whole circles, more on other ones."""
    added = []
    dropped = np.zeros(len(corners), dtype=bool)
    for shaft in sorted(shafts, key=lambda shaft: -int(_on_wall(corners, shaft).sum())):
        height, _, angle = shaft.polar(corners)
        on = _on_wall(corners, shaft) & ~dropped
        if on.sum() < 3:
            continue
        # Rings of corners, level by level. New ones lie on the true circle: between two sides more of them bring the
        # sides nearer to the wall.
        count = sides_of(1e-3 * max(shaft.radii))
        for h in np.unique(np.round(height[on], 3)):
            mine = on & (np.abs(height - h) < 2e-3)
            angles, is_whole = _around_axis(np.sort(angle[mine]), count)
            dropped |= mine & is_whole
            if len(angles):
                level = float(height[mine].mean())
                added.append(shaft.around(level, float(shaft.radius_at(level)), angles))
    if not added:
        return corners
    every = merge_near_points(np.concatenate([corners[~dropped], *added]))
    return np.asarray(every[np.sort(ConvexHull(every).vertices)])


def _on_wall(corners: Array, shaft: Region) -> Any:
    on = shaft.is_on_wall(corners, max(1e-5 * max(shaft.radii), SAME_CORNER_MM))
    return on & (shaft.polar(corners)[1] > SAME_CORNER_MM)


def _around_axis(ring: Array, count: int) -> tuple[Array, bool]:
    """Angles of the corners that a wall needs beyond those of a ring, and whether they stand for all of it."""
    if len(ring) < 3:
        return ring[:0], False
    gaps = np.diff(np.append(ring, ring[0] + 2.0 * np.pi))
    usual = float(np.median(gaps))
    if len(ring) >= 6 and gaps.max() < _WIDER * usual:
        return 2.0 * np.pi * (np.arange(count) + 0.5) / count, True
    # A wall that is part of a circle: each of its gaps is cut into equal ones, none wider than a side may be.
    many = np.ceil(gaps / (2.0 * np.pi / count) - 1e-9).astype(int)
    near = zip(*(each[gaps < _WIDER * usual] for each in (ring, gaps, many)), strict=True)
    return np.concatenate([ring[:0], *(a + gap * np.arange(1, n) / n for a, gap, n in near)]), False


def as_cylinders(pieces: list[Hull], shafts: Sequence[Region]) -> Iterator[Hull]:
    """Pieces, as true cylinders where all of their corners are on the ends of one."""
    cylinders = [s for s in shafts if s.kind == "cylinder" and THINNEST_M <= 1e-3 * s.radii[0] <= WIDEST_M]
    for piece in pieces:
        yield next((whole for shaft in cylinders if (whole := _as_cylinder(piece, shaft)) is not None), piece)


def _as_cylinder(piece: Hull, shaft: Region) -> Hull | None:
    corners = 1e3 * piece.corners
    radius = shaft.radii[0]
    height, distance, _ = shaft.polar(corners)
    low = float(height.min())
    high = float(height.max())
    if len(corners) < 16 or 5e-4 * (high - low) < THINNEST_M:
        return None
    # Every corner is on one of two level circles of the wall: the hull is a prism that stands for the cylinder.
    level = np.minimum(height - low, high - height) < SAME_CORNER_MM
    if not (level & (np.abs(distance - radius) < 1e-5 * radius + 1e-5)).all():
        return None
    center = 1e-3 * (shaft.point + (low + high) / 2.0 * shaft.direction)
    return cylinder_hull("", Cylinder(center, shaft.direction, 1e-3 * radius, 5e-4 * (high - low)))
