"""Whether a part rests on a table, and where it would tip over."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.solid import Piece, Solid, extent

_LOW_M = 2e-5
"""Corners so near to the lowest one carry."""
_LEAST_M = 5e-4
_SLOPE = 0.04
"""The centre of mass lies at least so far inside of what carries, and so much of its height."""
_LEVEL = 1e-6


class Stance(NamedTuple):
    """How a part stands on a level plane."""

    height_m: float
    """Of its frame over the plane."""
    stands: bool
    rolls: bool
    """It lies on a round wall: nothing but friction keeps it in its place."""


def stance(solid: Solid, R: Array) -> Stance:
    """How a solid stands that is turned like this, (3, 3)."""
    up = R[2]
    low = extent(solid.pieces, up)[0]
    points = [_lowest(piece, up, low) for piece in solid.pieces]
    base = (np.concatenate([np.zeros((0, 3)), *points]) @ R.T)[:, :2]
    middle = R @ solid.centroid
    margin = _margin(base, middle[:2])
    if margin >= max(_LEAST_M, _SLOPE * (middle[2] - low)):
        return Stance(-low, True, False)
    return Stance(-low, _on_line(base, middle[:2]), _on_line(base, middle[:2]))


def _lowest(piece: Piece, up: Array, low: float) -> Array:
    """The corners of a piece that touch the plane, (k, 3); of a level cylinder the ends of the line that does."""
    if isinstance(piece, Hull) and piece.cylinder is not None and abs(piece.cylinder.axis @ up) < _LEVEL:
        c = piece.cylinder
        if c.center @ up - c.radius > low + _LOW_M:
            return np.zeros((0, 3))
        reach = c.half_length * np.outer([-1.0, 1.0], c.axis)
        return np.asarray(c.center - c.radius * up + reach)
    return np.asarray(piece.corners[piece.corners @ up < low + _LOW_M])


def _margin(base: Array, at: Array) -> float:
    """How far a point is inside of the hull of others, [m]; negative where that is no area, or it lies outside."""
    from shapely import MultiPoint, Point

    hull = MultiPoint(base).convex_hull if len(base) else None
    if hull is None or hull.geom_type != "Polygon" or not hull.contains(Point(at)):
        return -1.0
    return float(hull.exterior.distance(Point(at)))


def _on_line(base: Array, at: Array) -> bool:
    """Whether what carries is a line below a point."""
    from shapely import MultiPoint, Point

    if (
        len(base) < 2
        or MultiPoint(base).minimum_rotated_rectangle.buffer(0.0).area > _LEAST_M * np.ptp(base, axis=0).max()
    ):
        return False
    line = MultiPoint(base).convex_hull
    return bool(line.distance(Point(at)) < _LEAST_M)
