"""Faces of a B-rep and their surfaces, [mm]."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.faces.fitting import Round
from apo_bench.importers.cad.solids.raw_solid import SolidPlace

_SAME = 1e-6
"""Faces on surfaces that differ by less, in parts of the size of the solid, are on one."""
_SAME_RAD = 1e-6


class Flat(NamedTuple):
    """A plane."""

    point: Array
    normal: Array
    residual: float


class Wall(NamedTuple):
    """A cylinder or a cone."""

    surface: Round
    residual: float


class BrepFace(NamedTuple):
    """A face of a solid."""

    surface: Flat | Wall | None
    """What contacts can be made with; None: any other one."""
    corners: Array
    """(c, 3)."""
    triangles: Any
    """(t, 3), counter-clockwise seen from outside; none if it cannot be cut into such."""


class BrepSolid(NamedTuple):
    """A solid, or a shell that may be one."""

    name: str
    faces: tuple[BrepFace, ...]
    places: tuple[SolidPlace, ...]


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
