"""What a CAD file becomes first: closed meshes whose triangles belong to faces with parameters, [mm]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, final

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.round_face import WHOLE_TURN
from apo_bench.parts.making.moments import Moments

Kind = Literal["plane", "cylinder", "cone", "other"]
Rgb = tuple[float, float, float]
"""0 to 1."""


@final
@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed mesh, or what will be one."""

    corners: Array
    """(k, 3)."""
    triangles: Any
    """(t, 3), whole numbers, counter-clockwise seen from outside."""

    @cached_property
    def across(self) -> Array:
        """Twice the area of each triangle as a vector along its normal, (t, 3)."""
        a, b, c = (self.corners[self.triangles[:, i]] for i in range(3))
        return np.asarray(np.cross(b - a, c - a))

    @cached_property
    def volume(self) -> float:
        """Negative if it is inside out, [mm^3]."""
        middle = self.corners.mean(axis=0)
        return float(((self.corners[self.triangles[:, 0]] - middle) * self.across).sum() / 6.0)

    @cached_property
    def extent(self) -> float:
        """The longest side of the aligned box around it."""
        return float(np.ptp(self.corners[self.triangles.ravel()], axis=0).max()) if len(self.triangles) else 0.0

    @cached_property
    def sides(self) -> Any:
        """Directed edges of the triangles, (3 t, 2): those from corner 0 to 1 first, then 1 to 2, then 2 to 0."""
        return np.concatenate([self.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])

    @cached_property
    def neighbours(self) -> Any:
        """Pairs of triangles with a common edge, (e, 2), of a closed mesh; the edge is directed as in the first."""
        return self._shared[0]

    @cached_property
    def edges(self) -> Any:
        """The corners of these edges, (e, 2)."""
        return self._shared[1]

    @cached_property
    def _shared(self) -> tuple[Any, Any]:
        low = self.sides.min(axis=1)
        high = self.sides.max(axis=1)
        order = np.lexsort((high, low))
        pairs = order.reshape(-1, 2)
        return pairs % len(self.triangles), self.sides[pairs[:, 0]]

    def part(self, triangles: Any) -> Mesh:
        """The mesh of some of the triangles, with the corners that they use, in their order."""
        used, index = np.unique(self.triangles[triangles], return_inverse=True)
        return Mesh(self.corners[used], index.reshape(-1, 3))


@final
@dataclass(frozen=True, eq=False)
class Region:
    """A face: triangles that lie on one plane, cylinder or cone, or on none of them."""

    kind: Kind
    triangles: Any
    """Which of the mesh, ascending."""
    residual: float = 0.0
    """How far its corners are from it at most, but for the sagitta of the tessellation, [mm]."""
    name: str = ""
    normal: Array | None = None
    """Of a plane, outwards."""
    point: Array | None = None
    """Of a plane; of an axis, the foot of the origin."""
    axis: Array | None = None
    span: tuple[float, float] = (0.0, 0.0)
    """Of a round one, along the axis from `point`."""
    radii: tuple[float, float] = (0.0, 0.0)
    """At both ends of the span."""
    hole: bool = False
    turn: float = WHOLE_TURN
    """How far around the axis it reaches, [rad]."""
    square: bool = False
    """Whether both ends are level circles, so that pieces can be rebuilt around it."""

    @property
    def is_round(self) -> bool:
        return self.kind in ("cylinder", "cone")

    @property
    def is_whole(self) -> bool:
        """Whether it goes all the way round."""
        return self.is_round and self.turn >= WHOLE_TURN - 1e-9

    @property
    def slope(self) -> float:
        """By how much the radius grows along the axis."""
        return (self.radii[1] - self.radii[0]) / (self.span[1] - self.span[0])

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """Two directions across the axis."""
        assert self.axis is not None
        x = np.eye(3)[int(np.abs(self.axis).argmin())]
        x = x - (x @ self.axis) * self.axis
        x /= np.linalg.norm(x)
        return x, np.cross(self.axis, x)

    @cached_property
    def box(self) -> Array:
        """The aligned box around a round one: its lowest and highest corner, (2, 3)."""
        assert self.axis is not None
        assert self.point is not None
        ends = self.point + np.outer(self.span, self.axis)
        reach = max(self.radii) * np.sqrt(np.maximum(1.0 - self.axis**2, 0.0))
        return np.array([ends.min(axis=0) - reach, ends.max(axis=0) + reach])

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Height along the axis, distance from it, angle around it, of points (k, 3)."""
        assert self.axis is not None
        assert self.point is not None
        x, y = self.across
        off = points - self.point
        return off @ self.axis, np.hypot(off @ x, off @ y), np.arctan2(off @ y, off @ x)

    def radius_at(self, height: Any) -> Any:
        return self.radii[0] + self.slope * (height - self.span[0])


class Place(NamedTuple):
    """One of the places at which a file has a solid."""

    name: str
    T: Array
    """Of the frame of the solid in that of the file, (4, 4), [mm]."""
    color: Rgb | None = None


@final
@dataclass(frozen=True, eq=False)
class RawSolid:
    """One solid of a file."""

    name: str
    mesh: Mesh
    regions: tuple[Region, ...]
    facets: Any
    """The flat piece that each triangle belongs to, (t,)."""
    places: tuple[Place, ...]
    """Where the file has it."""
    said: tuple[str, ...] = ()
    """What was mended."""
    moments: Moments | None = None
    """As the file has them, where it has more than triangles, [mm]."""

    def named(self) -> Mapping[str, Region]:
        return {region.name: region for region in self.regions if region.name}
