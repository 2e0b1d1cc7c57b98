"""Faces of a B-rep as a reader gives them, and their surfaces: as the file says, or fitted to points of a spline."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.faces.fitting import Round, axis_of, circle_through, refined
from apo_bench.cad.solids.raw_solid import SolidPlace
from apo_bench.geometry import Array

TRIANGLES_RAD = 0.2
"""The angle between neighbours on round walls, the same on walls around one axis."""
_SPLINE_MM = 5e-4
"""A spline whose points are this near to a plane, a cylinder or a cone is one."""
_SPLINE_RAD = 0.02
"""... and its normals."""
_FEWEST = 6
_SAME = 1e-6
_SAME_RAD = 1e-6
"""Faces on surfaces that differ by less, in parts of the size of the solid, are on one."""
_FLATTEST = 1e3
"""No round face of a spline is this many times as wide as the face."""


class BrepFace(NamedTuple):
    """A face of a solid."""

    kind: str
    """`plane`, `cylinder`, `cone`, `sphere`, `torus`, `free` for what is stored as a spline; `none`: no triangles."""
    point: Array
    """Of the plane or the axis, [mm]; of a free one, points on it, (k, 3)."""
    direction: Array
    """Normal or axis; of a free one, its normals there, (k, 3)."""
    radius: float
    """At the point."""
    slope: float
    """By how much the radius grows along the axis."""
    corners: Array
    """(c, 3)."""
    triangles: Any
    """(t, 3), counter-clockwise seen from outside."""


class BrepSolid(NamedTuple):
    """A solid, or a shell that may be one."""

    name: str
    faces: tuple[BrepFace, ...]
    places: tuple[SolidPlace, ...]


class Flat(NamedTuple):
    """A plane."""

    point: Array
    normal: Array
    residual: float


class Wall(NamedTuple):
    """A cylinder or a cone."""

    surface: Round
    residual: float


def surface_of(face: BrepFace) -> Flat | Wall | None:
    """What contacts can be made with; None for every other surface."""
    if face.kind == "plane":
        return Flat(face.point, face.direction, 0.0)
    if face.kind in ("cylinder", "cone"):
        return Wall(Round(face.point, face.direction, face.radius, face.slope), 0.0)
    if face.kind != "free" or len(face.point) < _FEWEST:
        return None
    free = (face.point, face.direction)
    return _flat(*free) or _wall(*free, False) or _wall(*free, True)


def _flat(points: Array, normals: Array) -> Flat | None:
    middle = points.mean(axis=0)
    # The plane of least squares: its normal is the direction in which the points spread least.
    n = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    residual = float(np.abs((points - middle) @ n).max())
    is_straight = (np.abs(normals @ n) > np.cos(_SPLINE_RAD)).all()
    return Flat(middle, n, residual) if residual < _SPLINE_MM and is_straight else None


def _wall(points: Array, normals: Array, cone: bool) -> Wall | None:
    wall = refined(circle_through(points, axis_of(normals, cone)), points, cone)
    if wall is None or wall.radius > _FLATTEST * np.ptp(points, axis=0).max():
        return None
    residual = float(np.abs(wall.off(points)).max())
    facing = np.abs((normals * wall.normals(wall.polar(points)[2])).sum(axis=1)) > np.cos(_SPLINE_RAD)
    return Wall(wall, residual) if residual < _SPLINE_MM and facing.all() else None


def is_same(a: Flat | Wall | None, b: Flat | Wall | None, size: float) -> bool:
    """Whether two faces lie on one surface; never for those of other kinds.

    Args:
        size: Of the solid, [mm].
    """
    if isinstance(a, Flat) and isinstance(b, Flat):
        near = _SAME * size + 2.0 * (a.residual + b.residual)
        is_parallel = np.linalg.norm(np.cross(a.normal, b.normal)) <= _SAME_RAD + near / size
        return bool(is_parallel and abs((b.point - a.point) @ a.normal) < near)
    if not (isinstance(a, Wall) and isinstance(b, Wall)):
        return False
    near = _SAME * size + 2.0 * (a.residual + b.residual)
    near_rad = _SAME_RAD + near / size
    if np.linalg.norm(np.cross(a.surface.axis, b.surface.axis)) > near_rad:
        return False
    # One axis, and the other cone seen from the first: it may point the other way, and states its radius elsewhere.
    height, distance, _ = a.surface.polar(b.surface.point[None])
    slope = b.surface.slope * float(np.sign(a.surface.axis @ b.surface.axis))
    radius = a.surface.radius + a.surface.slope * height[0]
    return bool(
        distance[0] < near and abs(slope - a.surface.slope) < near_rad and abs(radius - b.surface.radius) < near
    )
