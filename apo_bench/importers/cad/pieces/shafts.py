"""Refine the corners of pieces of round shafts to the fitted wall, or make the pieces true cylinders, [mm]."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from apo_bench.geometry import Array, Cylinder, Hull, count_sides, make_cylinder_hull
from apo_bench.importers.cad.pieces.corners import merge_near_points
from apo_bench.importers.cad.solids import SAME_CORNER_MM, Region
from apo_bench.scenario.parts.limits import THINNEST_M, WIDEST_M

_WIDER = 1.6
"""A gap between corners of a ring that is wider than the median by this factor is no part of the wall."""


def refine_shaft_corners(corners: Array, shafts: Sequence[Region]) -> Array:
    """Return the corners of a piece, (k, 3), with rings of corners on shafts refined to the fitted wall.

    Whole circles of corners are replaced by evenly spaced ones; arcs get further corners in between.
    """
    added = []
    dropped = np.zeros(len(corners), dtype=bool)
    # The shaft with most corners first.
    for shaft in sorted(shafts, key=lambda shaft: -int(_lies_on_shaft(corners, shaft).sum())):
        height, _, angle = shaft.polar(corners)
        on = _lies_on_shaft(corners, shaft) & ~dropped
        if on.sum() < 3:
            continue
        # Corners form rings, one for each height. New corners lie on the true circle, so that more of them bring the
        # sides nearer to the wall.
        count = count_sides(1e-3 * max(shaft.radii))
        for h in np.unique(np.round(height[on], 3)):
            mine = on & (np.abs(height - h) < 2e-3)
            angles, is_whole = _list_added_angles(np.sort(angle[mine]), count)
            dropped |= mine & is_whole
            if len(angles):
                level = float(height[mine].mean())
                added.append(shaft.around(level, float(shaft.radius_at(level)), angles))
    if not added:
        return corners
    every = merge_near_points(np.concatenate([corners[~dropped], *added]))
    return np.asarray(every[np.sort(ConvexHull(every).vertices)])


def _lies_on_shaft(corners: Array, shaft: Region) -> Any:
    """Return which corners, (k, 3), are on the wall of a shaft, (k,); the tip of a cone does not count."""
    on = shaft.is_on_wall(corners, max(1e-5 * max(shaft.radii), SAME_CORNER_MM))
    return on & (shaft.polar(corners)[1] > SAME_CORNER_MM)


def _list_added_angles(ring: Array, count: int) -> tuple[Array, bool]:
    """Return the angles of the corners to add to a ring, and whether they replace the whole ring.

    Args:
        ring: Angles of the corners of the ring, ascending, [rad].
        count: Corners of a whole circle.
    """
    if len(ring) < 3:
        return ring[:0], False
    gaps = np.diff(np.append(ring, ring[0] + 2.0 * np.pi))
    usual = float(np.median(gaps))
    if len(ring) >= 6 and gaps.max() < _WIDER * usual:
        return 2.0 * np.pi * (np.arange(count) + 0.5) / count, True
    # An arc: divide each of its gaps evenly so that none is wider than a side may be.
    many = np.ceil(gaps / (2.0 * np.pi / count) - 1e-9).astype(int)
    near = zip(*(each[gaps < _WIDER * usual] for each in (ring, gaps, many)), strict=True)
    return np.concatenate([ring[:0], *(a + gap * np.arange(1, n) / n for a, gap, n in near)]), False


def convert_to_cylinders(pieces: list[Hull], shafts: Sequence[Region]) -> Iterator[Hull]:
    """Yield the pieces, [m], with those whose corners are all on the two ends of a cylinder made true cylinders."""
    cylinders = [s for s in shafts if s.kind == "cylinder" and THINNEST_M <= 1e-3 * s.radii[0] <= WIDEST_M]
    for piece in pieces:
        yield next((whole for shaft in cylinders if (whole := _convert_to_cylinder(piece, shaft)) is not None), piece)


def _convert_to_cylinder(piece: Hull, shaft: Region) -> Hull | None:
    """Return a piece as a true cylinder, [m]; None if some corner is not on the two end circles of the shaft."""
    corners = 1e3 * piece.corners
    radius = shaft.radii[0]
    height, distance, _ = shaft.polar(corners)
    low = float(height.min())
    high = float(height.max())
    if len(corners) < 16 or 5e-4 * (high - low) < THINNEST_M:  # too few corners for a round piece, or too short
        return None
    # All corners are on two level circles of the wall, so the hull is a prism that approximates the cylinder.
    level = np.minimum(height - low, high - height) < SAME_CORNER_MM
    if not (level & (np.abs(distance - radius) < 1e-5 * radius + 1e-5)).all():
        return None
    center = 1e-3 * (shaft.point + (low + high) / 2.0 * shaft.direction)
    return make_cylinder_hull("", Cylinder(center, shaft.direction, 1e-3 * radius, 5e-4 * (high - low)))
