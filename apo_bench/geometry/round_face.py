"""Faces of revolution: walls of holes and shafts, cones such as chamfers and tapers, and rims, the circles of edges."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, copy_frozen, freeze, make_copyable
from apo_bench.geometry.polygon import find_direction_across

RoundKind = Literal["cylinder", "cone", "rim"]
WHOLE_TURN = 2.0 * np.pi
"""The angle of a whole turn, [rad]."""
_SAME_M = 1e-9
"""Lengths that differ by less are equal, [m]."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class RoundFace:
    """A piece of a cylinder or a cone, or a circle (a rim), in the frame of its solid."""

    name: str
    point: Array
    """A point of the axis, (3,), [m]; the origin of `span`."""
    axis: Array
    """Unit vector, (3,). Its sense has no meaning for a cylinder; of a rim it points out of the part."""
    span: tuple[float, float]
    """Begin and end of the face along the axis, measured from `point`, [m]; equal for a rim."""
    radii: tuple[float, float]
    """Radius at the begin and at the end of the span, [m]."""
    hole: bool
    """True: material outside of the wall, a hole. False: material inside, a shaft."""
    fit: bool = False
    """Whether the physical part recedes here by the clearance; the nominal face does not."""
    extent_rad: float = WHOLE_TURN
    """Angle that the face covers about the axis."""
    toward: Array | None = None
    """Direction from the axis to the middle of the face, unit vector, (3,); None for a whole turn."""

    def __post_init__(self) -> None:
        freeze(self, point=(3,), axis=(3,), toward=(3,))

    @property
    def kind(self) -> RoundKind:
        """`rim` if the span has no length, `cylinder` if both radii are equal, else `cone`."""
        if self.span[1] - self.span[0] < _SAME_M:
            return "rim"
        return "cylinder" if abs(self.radii[1] - self.radii[0]) < _SAME_M else "cone"

    @property
    def length(self) -> float:
        """Length along the axis, [m]."""
        return self.span[1] - self.span[0]

    @property
    def radius(self) -> float:
        """The radius of a cylinder or rim, or the mean radius of a cone, [m]."""
        return (self.radii[0] + self.radii[1]) / 2

    @property
    def slope(self) -> float:
        """Growth of the radius per length along the axis; 1 for a cone of 45 degrees to its axis."""
        return (self.radii[1] - self.radii[0]) / self.length if self.length >= _SAME_M else 0.0

    @cached_property
    def ends(self) -> Array:
        """The points of the axis at the begin and end of the span, (2, 3), [m]."""
        return copy_frozen(self.point + np.outer(self.span, self.axis), 2, 3)

    @property
    def middle(self) -> Array:
        """The middle between the two ends, (3,), [m]."""
        return np.asarray(self.ends.mean(axis=0))

    @property
    def wider(self) -> Array:
        """The axis, (3,), with a sense: of a cone towards its wider end, of a rim to where the cone that it meets is
        wider.

        A rim's `axis` points out of the part. The cone of a shaft that sits in a hole widens in that direction; a
        countersink that takes the end of a shaft narrows, so the axis of a shaft's rim is reversed.
        """
        if self.kind == "cone":
            return np.asarray(np.sign(self.slope) * self.axis)
        return -self.axis if self.kind == "rim" and not self.hole else self.axis

    def around(self, turn_rad: ArrayLike) -> Array:
        """Unit vectors perpendicular to the axis, (*, 3), at angles from the x axis of `frame`."""
        turn = np.asarray(turn_rad)[..., None]
        return np.asarray(np.cos(turn) * self.frame[:3, 0] + np.sin(turn) * self.frame[:3, 1])

    def where_wide(self, radius: float) -> Array:
        """The point of the axis, (3,), [m], where a cone has the given radius; the middle of a rim."""
        if self.kind == "rim":
            return self.middle
        return np.asarray(self.point + (self.span[0] + (radius - self.radii[0]) / self.slope) * self.axis)

    @cached_property
    def frame(self) -> Array:
        """A frame at `point`, (4, 4): z along the axis, x towards the middle of an arc, or across the axis for a whole
        turn.
        """
        z = self.axis
        x = find_direction_across(z, self.toward)
        return copy_frozen(pose.rigid(np.column_stack([x, np.cross(z, x), z]), self.point), 4, 4)
