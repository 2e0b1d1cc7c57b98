"""Types of values in scenario files: lengths, poses, axes and intervals, with their checks."""

from typing import Annotated

import numpy as np
from msgspec import Meta

from apo_bench.errors import require
from apo_bench.geometry import Array, pose
from apo_bench.io import FileTable, Quadruple, Triple, check_quaternion

LARGEST_LENGTH_MM = 2000.0
"""Largest length in a scenario, beyond the reach of an arm on a table."""
_FARTHEST_MM = 1e5
"""Largest coordinate of an `AnyPose`."""
Length = Annotated[float, Meta(ge=-LARGEST_LENGTH_MM, le=LARGEST_LENGTH_MM)]
Point = tuple[Length, Length, Length]
"""[mm]."""
Angle = Annotated[float, Meta(ge=-360.0, le=360.0)]
"""[degrees]."""
_Far = Annotated[float, Meta(ge=-_FARTHEST_MM, le=_FARTHEST_MM)]
Axis = str | Triple
"""`"x"`, `"+x"`, `"-x"` ... or three numbers."""
# Name of an axis, with or without a sign -> unit vector.
_AXES = {f"{sign}{'xyz'[i]}": value * np.eye(3)[i] for sign, value in (("", 1), ("+", 1), ("-", -1)) for i in range(3)}


class Pose(FileTable, frozen=True, kw_only=True):
    """A pose in the frame of the world or of the assembly."""

    at_mm: Point
    turn_deg: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Array:
        """(4, 4), [m]."""
        return pose.at(1e-3 * np.array(self.at_mm), self.turn_deg)


class AnyPose(FileTable, frozen=True, kw_only=True):
    """A pose whose rotation is stated as angles or as a quaternion in either order of components."""

    at_mm: tuple[_Far, _Far, _Far]
    turn_deg: tuple[Angle, Angle, Angle] | None = None
    quaternion_wxyz: Quadruple | None = None
    quaternion_xyzw: Quadruple | None = None

    def matrix(self, place: str) -> Array:
        """(4, 4), [m].

        Raises:
            InputError: The rotation is stated twice, or a quaternion is not of length 1.
        """
        stated = [turn for turn in (self.turn_deg, self.quaternion_wxyz, self.quaternion_xyzw) if turn is not None]
        require(len(stated) <= 1, f"{place}: turn_deg and quaternions state the same; keep one.")
        at = 1e-3 * np.array(self.at_mm)
        q = self.quaternion_wxyz or (self.quaternion_xyzw and self.quaternion_xyzw[-1:] + self.quaternion_xyzw[:-1])
        if q is None:
            return pose.at(at, self.turn_deg or (0.0, 0.0, 0.0))
        return pose.unpack(np.concatenate([at, check_quaternion(q, f"{place}, quaternion")]))


def normalize_axis(stated: Axis, place: str) -> Array:
    """The unit vector (3,) of a stated axis: `x`, `+x`, `-x`, ..., or three numbers.

    Args:
        place: File and key, for messages.

    Raises:
        InputError: The name is unknown, or all numbers are zero.
    """
    needed = f"{place}: an axis is needed: x, y, z with or without a sign, or three numbers that are not all zero."
    if isinstance(stated, str):
        require(stated in _AXES, needed)
        return _AXES[stated]
    vector = np.array(stated)
    require(np.linalg.norm(vector / max(1.0, np.abs(vector).max())) >= 1e-9, needed)
    return vector / np.linalg.norm(vector)


def check_span(span: tuple[float, float], place: str) -> tuple[float, float]:
    """Return an interval unchanged.

    Raises:
        InputError: The first number is larger than the second.
    """
    require(span[0] <= span[1], f"{place}: a lowest and a highest number are needed, in this order.")
    return span
