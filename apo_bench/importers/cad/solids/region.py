"""A region: the triangles of a mesh on one plane, cylinder or cone, with the parameters of that surface."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, final

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array

RegionKind = Literal["plane", "cylinder", "cone", "other"]
SAME_CORNER_MM = 2e-4
"""Corners of a piece nearer to each other than this are the same."""


def find_square_axes(direction: Array) -> tuple[Array, Array]:
    """Return two unit vectors x, y with x, y, z right-handed, for a unit vector z.

    x is the projection of the frame's axis that is farthest from z.
    """
    x = np.eye(3)[int(np.abs(direction).argmin())]
    x = x - (x @ direction) * direction
    x /= np.linalg.norm(x)
    return x, np.cross(direction, x)


@final
@dataclass(frozen=True, eq=False)
class Region:
    """Triangles that lie on one plane, cylinder or cone, or on a free-form surface."""

    kind: RegionKind
    triangles: Any
    """Indices of triangles of the mesh, ascending."""
    name: str = ""
    direction: Array = field(default_factory=lambda: np.zeros(3))
    """The outward normal of a plane, or the axis of a round region; unit vector."""
    point: Array = field(default_factory=lambda: np.zeros(3))
    """A point of the plane; for a round region the foot of the origin on the axis."""
    span: tuple[float, float] = (0.0, 0.0)
    """The two ends of a round region, along the axis from `point`."""
    radii: tuple[float, float] = (0.0, 0.0)
    """The radii at the two ends of the span."""
    hole: bool = False
    turn: float = WHOLE_TURN
    """The angle about the axis that the region covers, [rad]."""
    sides: int = 0
    """The number of facets around a full turn in a mesh file; 0: unknown or not from a mesh."""
    square: bool = False
    """Whether both ends are circles square to the axis, so that pieces can be rebuilt around the wall."""

    @property
    def is_round(self) -> bool:
        return self.kind in ("cylinder", "cone")

    @property
    def is_whole(self) -> bool:
        """Whether it goes all the way round."""
        return self.is_round and self.turn >= WHOLE_TURN - 1e-9

    @property
    def slope(self) -> float:
        """The increase of the radius per length along the axis."""
        return (self.radii[1] - self.radii[0]) / (self.span[1] - self.span[0])

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """Two unit vectors across the axis."""
        return find_square_axes(self.direction)

    @property
    def ends(self) -> Array:
        """The points of the axis at both ends of a round region, (2, 3)."""
        return self.point + np.outer(self.span, self.direction)

    @cached_property
    def box(self) -> Array:
        """The axis-aligned bounding box of a round region: lowest and highest corner, (2, 3)."""
        # A circle of radius r across a unit axis z reaches r sqrt(1 - z_k^2) along the k-th axis of the frame.
        reach = max(self.radii) * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return np.array([self.ends.min(axis=0) - reach, self.ends.max(axis=0) + reach])

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Return height along the axis, distance from the axis and angle about it of points (k, 3), each (k,)."""
        x, y = self.across
        off = points - self.point
        return off @ self.direction, np.hypot(off @ x, off @ y), np.arctan2(off @ y, off @ x)

    def radius_at(self, height: Any) -> Any:
        return self.radii[0] + self.slope * (height - self.span[0])

    def is_on_wall(self, points: Array, near: float) -> Any:
        """Return which points, (k, 3), are within `near` of the wall and between its ends, (k,)."""
        height, distance, _ = self.polar(points)
        within = (height > self.span[0] - SAME_CORNER_MM) & (height < self.span[1] + SAME_CORNER_MM)
        return within & (np.abs(distance - self.radius_at(height)) < near)

    def around(self, height: float, radius: float, angle: Array) -> Array:
        """Return points at angles about the axis, [rad], at a height along it and a radius, (k, 3)."""
        x, y = self.across
        return self.point + height * self.direction + radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y))
