"""What the reader of STEP files finds: solids with the surface and the triangles of each face."""

from typing import Any, NamedTuple

from apo_bench.cad.raw_solid import SolidPlace
from apo_bench.geometry.arrays import Array

TRIANGLES_RAD = 0.2
"""The angle between neighbours on round walls, the same on walls around one axis."""


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
    size: float
    """Volume, [mm^3]."""
    centroid: Array
    inertia: Array
    """About the centroid, [mm^5]."""
    places: tuple[SolidPlace, ...]
