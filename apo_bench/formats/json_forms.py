"""JSON forms of poses and covariances, in mm and degrees.

A pose is `position_mm` [x, y, z] and `quaternion_wxyz` [w, x, y, z] in the world frame. Operations are numbered from 1.
A covariance is that of the body twist (x, y, z, rx, ry, rz) in mm and degrees.
"""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from apo_bench.geometry import FARTHEST_M, Array, pose
from apo_bench.io import FileTable, Quadruple, Text, check_quaternion, write_file

TO_MM_DEG = np.array([1e3] * 3 + [180.0 / np.pi] * 3)  # factors from a twist in m and rad to mm and deg
_FARTHEST_MM = 1e3 * FARTHEST_M  # largest coordinate of a position
Coordinate = Annotated[float, Meta(ge=-_FARTHEST_MM, le=_FARTHEST_MM)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Number = Annotated[int, Meta(ge=1)]
"""Number of an operation, counted from 1."""
Form = dict[str, Any]
"""A JSON object."""


class PoseForm(FileTable, frozen=True, kw_only=True):
    """A pose in the world frame."""

    position_mm: Position
    quaternion_wxyz: Quadruple

    def matrix(self, place: str) -> Array:
        """Return the pose as a matrix, (4, 4), [m].

        Args:
            place: File and key, for error messages.

        Raises:
            InputError: The quaternion is not of length 1.
        """
        q = check_quaternion(self.quaternion_wxyz, f"{place}, quaternion_wxyz")
        return pose.unpack(np.concatenate([np.array(self.position_mm) * 1e-3, q]))


class PlannedOperation(PoseForm, frozen=True, kw_only=True):
    """The target pose of an operation in a plan."""

    operation: Number
    part: Text


def write_form(form: Form, path: str | Path) -> None:
    """Write a form to a UTF-8 JSON file.

    Raises:
        InputError: The file cannot be written.
    """
    write_file(path, json.dumps(form, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def make_pose_form(T: Array) -> Form:
    """Return the form of a pose (4, 4), [m]: position in mm, and quaternion."""
    packed = pose.pack(T)
    return {"position_mm": (packed[:3] * 1e3).tolist(), "quaternion_wxyz": packed[3:].tolist()}


def make_covariance_form(C: Array) -> Any:
    """Return a covariance (6, 6), [m, rad], as nested lists in mm and degrees."""
    return (C * np.outer(TO_MM_DEG, TO_MM_DEG)).tolist()
