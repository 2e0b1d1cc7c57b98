"""A face of a mesh: the triangles on one plane, cylinder or cone, and its parameters."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, final

import numpy as np

from apo_bench.geometry import WHOLE_TURN, Array

RegionKind = Literal["plane", "cylinder", "cone", "other"]
SAME_CORNER_MM = 2e-4
"""Corners of a piece nearer to each other than this are one."""


def find_square_axes(direction: Array) -> tuple[Array, Array]:
    """Return two unit vectors square to a unit vector z: x from the frame's axis that is farthest from z, y = z x x."""
    x = np.eye(3)[int(np.abs(direction).argmin())]
    x = x - (x @ direction) * direction
    x /= np.linalg.norm(x)
    return x, np.cross(direction, x)


@final
@dataclass(frozen=True, eq=False)
class Region:
    """A face: triangles that lie on one plane, cylinder or cone, or on none of them."""

    kind: RegionKind
    triangles: Any
    """Which of the mesh, ascending."""
    name: str = ""
    direction: Array = field(default_factory=lambda: np.zeros(3))
    """The outward normal of a plane, the axis of a round one."""
    point: Array = field(default_factory=lambda: np.zeros(3))
    """Of a plane; of an axis, the foot of the origin."""
    span: tuple[float, float] = (0.0, 0.0)
    """Of a round one, along the axis from `point`."""
    radii: tuple[float, float] = (0.0, 0.0)
    """At both ends of the span."""
    hole: bool = False
    turn: float = WHOLE_TURN
    """How far around the axis it reaches, [rad]."""
    sides: int = 0
    """How many flat ones a whole turn of it had in the file; 0: that is not known, or it is no mesh."""
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
        return find_square_axes(self.direction)

    @property
    def ends(self) -> Array:
        """Where the axis of a round one enters and leaves it, (2, 3)."""
        return self.point + np.outer(self.span, self.direction)

    @cached_property
    def box(self) -> Array:
        """The aligned box around a round one: its lowest and highest corner, (2, 3)."""
        # A circle of radius r across a unit axis z reaches r sqrt(1 - z_k^2) along the k-th axis of the frame.
        reach = max(self.radii) * np.sqrt(np.maximum(1.0 - self.direction**2, 0.0))
        return np.array([self.ends.min(axis=0) - reach, self.ends.max(axis=0) + reach])

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Return height along the axis, distance from it, angle around it, of points (k, 3)."""
        x, y = self.across
        off = points - self.point
        return off @ self.direction, np.hypot(off @ x, off @ y), np.arctan2(off @ y, off @ x)

    def radius_at(self, height: Any) -> Any:
        return self.radii[0] + self.slope * (height - self.span[0])

    def is_on_wall(self, points: Array, near: float) -> Any:
        """Return which points, (k, 3), are this near to the wall, between its ends."""
        height, distance, _ = self.polar(points)
        within = (height > self.span[0] - SAME_CORNER_MM) & (height < self.span[1] + SAME_CORNER_MM)
        return within & (np.abs(distance - self.radius_at(height)) < near)

    def around(self, height: float, radius: float, angle: Array) -> Array:
        """Return points at angles around the axis, (k, 3)."""
        x, y = self.across
        return self.point + height * self.direction + radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y))
