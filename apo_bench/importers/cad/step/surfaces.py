"""Faces of a B-rep, and whether two of them lie on one surface, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.faces.fitting import Round
from apo_bench.importers.cad.solids import SolidPlace

_SAME = 1e-6
"""Surfaces that differ by less, as a share of the size of the solid, are one."""
_SAME_RAD = 1e-6


class Plane(NamedTuple):
    """A plane."""

    point: Array
    normal: Array


class BrepFace(NamedTuple):
    """A face of a solid."""

    surface: Plane | Round | None
    """A surface that can make contacts, or None."""
    residual: float
    """The largest distance of a spline from that surface."""
    corners: Array
    """(c, 3)."""
    triangles: Any
    """(t, 3), counter-clockwise seen from outside; none if the face cannot be cut into triangles."""


class BrepSolid(NamedTuple):
    """A solid, or a shell that may be one."""

    name: str
    faces: tuple[BrepFace, ...]
    places: tuple[SolidPlace, ...]


def is_same_surface(first: BrepFace, second: BrepFace, size: float) -> bool:
    """Whether two faces lie on one plane, cylinder or cone.

    Args:
        size: Of the solid, [mm].
    """
    near = _SAME * size + 2.0 * (first.residual + second.residual)
    near_rad = _SAME_RAD + near / size
    a, b = first.surface, second.surface
    if isinstance(a, Plane) and isinstance(b, Plane):
        is_parallel = np.linalg.norm(np.cross(a.normal, b.normal)) <= near_rad
        return bool(is_parallel and abs((b.point - a.point) @ a.normal) < near)
    if not (isinstance(a, Round) and isinstance(b, Round)) or np.linalg.norm(np.cross(a.axis, b.axis)) > near_rad:
        return False
    # The second cone measured from the axis of the first: it may point the other way, and state its radius elsewhere.
    height, distance, _ = a.polar(b.point[None])
    slope = b.slope * float(np.sign(a.axis @ b.axis))
    radius = a.radius + a.slope * height[0]
    return bool(distance[0] < near and abs(slope - a.slope) < near_rad and abs(radius - b.radius) < near)
