"""Faces of revolution: the walls of holes, shafts, chamfers and tapers, and the rims of holes."""

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
_SAME_M = 1e-9


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class RoundFace:
    """A piece of a cylinder or a cone, or the circle at its end, in the frame of its solid."""

    name: str
    point: Array
    """A point of the axis, (3,), [m]."""
    axis: Array
    """Unit vector, (3,). Its sense has no meaning for a cylinder; of a rim it looks out of the part."""
    span: tuple[float, float]
    """From where to where along the axis, from `point`, [m]; both the same: a rim."""
    radii: tuple[float, float]
    """At both ends of the span, [m]."""
    hole: bool
    """The part is outside: a hole. Otherwise it is inside: a shaft."""
    fit: bool = False
    """The physical part recedes here by the clearance; the nominal face does not."""
    extent_rad: float = WHOLE_TURN
    """How far around the axis it reaches."""
    toward: Array | None = None
    """From the axis to the middle of the face, unit vector, (3,); None of a whole turn."""

    def __post_init__(self) -> None:
        freeze(self, point=(3,), axis=(3,), toward=(3,))

    @property
    def kind(self) -> RoundKind:
        if self.span[1] - self.span[0] < _SAME_M:
            return "rim"
        return "cylinder" if abs(self.radii[1] - self.radii[0]) < _SAME_M else "cone"

    @property
    def length(self) -> float:
        """Along the axis, [m]."""
        return self.span[1] - self.span[0]

    @property
    def radius(self) -> float:
        """Of a cylinder or a rim; in the middle of a cone, [m]."""
        return (self.radii[0] + self.radii[1]) / 2

    @property
    def slope(self) -> float:
        """By how much the radius grows along the axis, 1 for a cone of 45 degrees to its axis."""
        return (self.radii[1] - self.radii[0]) / self.length if self.length >= _SAME_M else 0.0

    @cached_property
    def ends(self) -> Array:
        """Where the axis enters and leaves the face, (2, 3), [m]."""
        return copy_frozen(self.point + np.outer(self.span, self.axis), 2, 3)

    @property
    def middle(self) -> Array:
        """The middle of the axis within the face, (3,), [m]."""
        return np.asarray(self.ends.mean(axis=0))

    @property
    def wider(self) -> Array:
        """The axis, (3,); of a cone or a rim towards where what is inside of it is wider.

        A rim looks out of its part: the cone of a shaft that sits in a hole gets wider that way, the countersink that a
        shaft's end sits in gets narrower.
        """
        if self.kind == "cone":
            return np.asarray(np.sign(self.slope) * self.axis)
        return -self.axis if self.kind == "rim" and not self.hole else self.axis

    def around(self, turn_rad: ArrayLike) -> Array:
        """Directions across the axis, (*, 3), turned about it from x of `frame`."""
        turn = np.asarray(turn_rad)[..., None]
        return np.asarray(np.cos(turn) * self.frame[:3, 0] + np.sin(turn) * self.frame[:3, 1])

    def where_wide(self, radius: float) -> Array:
        """The point of the axis, (3,), where a cone has a radius, [m]; the middle of a rim."""
        if self.kind == "rim":
            return self.middle
        return np.asarray(self.point + (self.span[0] + (radius - self.radii[0]) / self.slope) * self.axis)

    @cached_property
    def frame(self) -> Array:
        """A frame on the axis, z along it, x towards the middle of the face if there is one, (4, 4)."""
        z = self.axis
        x = find_direction_across(z, self.toward)
        return copy_frozen(pose.rigid(np.column_stack([x, np.cross(z, x), z]), self.point), 4, 4)
