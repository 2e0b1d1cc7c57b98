"""Surfaces of faces of a B-rep: as the file says, or fitted to points where it says a spline."""

from typing import NamedTuple

import numpy as np

from apo_bench.cad.brep import BrepFace
from apo_bench.cad.fitting import Round, axis_of, circle_through, refined
from apo_bench.geometry.arrays import Array

_SPLINE_MM = 5e-4
"""A spline whose points are this near to a plane, a cylinder or a cone is one."""
_SPLINE_RAD = 0.02
"""... and its normals."""
_FEWEST = 6
_LEAST_SLOPE = 1e-6
_SAME = 1e-6
_SAME_RAD = 1e-6
"""Faces on surfaces that differ by less, in parts of the size of the solid, are on one."""
_FLATTEST = 1e3
"""No round face of a spline is this many times as wide as the face."""


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
        return Flat(face.point, face.way, 0.0)
    if face.kind in ("cylinder", "cone"):
        return Wall(Round(face.point, face.way, face.radius, face.slope), 0.0)
    if face.kind != "free" or len(face.point) < _FEWEST:
        return None
    return _flat(face.point, face.way) or _wall(face.point, face.way, False) or _wall(face.point, face.way, True)


def _flat(points: Array, normals: Array) -> Flat | None:
    middle = points.mean(axis=0)
    n = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    residual = float(np.abs((points - middle) @ n).max())
    straight = (np.abs(normals @ n) > np.cos(_SPLINE_RAD)).all()
    return Flat(middle, n, residual) if residual < _SPLINE_MM and straight else None


def _wall(points: Array, normals: Array, cone: bool) -> Wall | None:
    first = circle_through(points, axis_of(normals, cone))
    found = None if first is None else refined(first, points, cone)
    if found is None or found.radius > _FLATTEST * np.ptp(points, axis=0).max():
        return None
    height, distance, out = found.polar(points)
    bevel = np.hypot(1.0, found.slope)
    residual = float(np.abs((distance - found.radius - found.slope * height) / bevel).max())
    true = (out - found.slope * found.axis) / bevel
    facing = np.abs((normals * true).sum(axis=1)) > np.cos(_SPLINE_RAD)
    return Wall(found, residual) if residual < _SPLINE_MM and facing.all() else None


def same(a: Flat | Wall | None, b: Flat | Wall | None, size: float) -> bool:
    """Whether two faces lie on one surface; never for those of other kinds.

    Args:
        size: Of the solid, [mm].
    """
    near = _SAME * size + (0.0 if a is None or b is None else 2.0 * (a.residual + b.residual))
    if isinstance(a, Flat) and isinstance(b, Flat):
        if np.linalg.norm(np.cross(a.normal, b.normal)) > _SAME_RAD + near / size:
            return False
        return bool(abs((b.point - a.point) @ a.normal) < near)
    if not (isinstance(a, Wall) and isinstance(b, Wall)):
        return False
    one = a.surface
    other = b.surface
    if np.linalg.norm(np.cross(one.axis, other.axis)) > _SAME_RAD + near / size:
        return False
    height, distance, _ = one.polar(other.point[None])
    slope = other.slope * float(np.sign(one.axis @ other.axis))
    return bool(
        distance[0] < near
        and abs(slope - one.slope) < _SAME_RAD + near / size
        and abs(one.radius + one.slope * height[0] - other.radius) < near
    )
