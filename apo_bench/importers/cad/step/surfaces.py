"""Faces of a B-rep, and the test whether two of them lie on one surface, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.faces.surface_fitting import RoundSurface
from apo_bench.importers.cad.solids import SolidPlace

_SAME = 1e-6
"""Surfaces that differ by less are the same, as a share of the size of the solid."""
_SAME_RAD = 1e-6  # the same for angles


class Plane(NamedTuple):
    """An infinite plane."""

    point: Array
    normal: Array


class BrepFace(NamedTuple):
    """A face of a B-rep solid."""

    surface: Plane | RoundSurface | None
    """The surface of a face that can make contacts; None for free-form faces."""
    residual: float
    """Largest distance between a spline and that surface."""
    corners: Array
    """(c, 3), coordinates."""
    triangles: Any
    """(t, 3), indices of corners, counter-clockwise seen from outside; empty if the face could not be triangulated."""


class BrepSolid(NamedTuple):
    """A solid, or a shell that may enclose one, with the places of its copies."""

    name: str
    """The name of its component."""
    faces: tuple[BrepFace, ...]
    places: tuple[SolidPlace, ...]
    component: int = 0
    """The number of its component; a component may have several solids."""


def is_same_surface(first: BrepFace, second: BrepFace, size: float) -> bool:
    """Whether two faces lie on one plane, cylinder or cone.

    Args:
        size: Size of the solid, [mm].
    """
    near = _SAME * size + 2.0 * (first.residual + second.residual)
    near_rad = _SAME_RAD + near / size
    a, b = first.surface, second.surface
    if isinstance(a, Plane) and isinstance(b, Plane):
        is_parallel = np.linalg.norm(np.cross(a.normal, b.normal)) <= near_rad
        return bool(is_parallel and abs((b.point - a.point) @ a.normal) < near)
    if (
        not (isinstance(a, RoundSurface) and isinstance(b, RoundSurface))
        or np.linalg.norm(np.cross(a.axis, b.axis)) > near_rad
    ):
        return False
    # Measure the second surface from the axis of the first: its axis may be reversed, and its radius stated elsewhere.
    height, distance, _ = a.polar(b.point[None])
    slope = b.slope * float(np.sign(a.axis @ b.axis))
    radius = a.radius + a.slope * height[0]
    return bool(distance[0] < near and abs(slope - a.slope) < near_rad and abs(radius - b.radius) < near)
