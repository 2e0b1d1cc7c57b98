"""Recognise the meaning and the unit of a log's columns from their names."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    "angle": {"deg": np.pi / 180.0, "rad": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
"""Quantity -> unit -> factor to m, rad or s."""
POSITION = ("x", "y", "z")  # meanings of columns, here and below
QUATERNION = ("qw", "qx", "qy", "qz")
NUMBERED_QUATERNION = ("q0", "q1", "q2", "q3")  # the camera file states their order
ROTATION_VECTOR = ("rx", "ry", "rz")
AXIS_AND_ANGLE = ("ax", "ay", "az", "angle")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
EULER_ANGLES = ("roll", "pitch", "yaw")
NUMBERED_EULER_ANGLES = ("e1", "e2", "e3")  # about the axes that `euler` of the camera file states
# A log has the columns of exactly one of these.
ROTATIONS = (
    QUATERNION,
    NUMBERED_QUATERNION,
    ROTATION_VECTOR,
    AXIS_AND_ANGLE,
    MATRIX,
    EULER_ANGLES,
    NUMBERED_EULER_ANGLES,
)
QUANTITIES: Mapping[str, str] = {
    "t": "time",
    **dict.fromkeys(POSITION, "length"),
    **dict.fromkeys(("angle", *ROTATION_VECTOR, *EULER_ANGLES, *NUMBERED_EULER_ANGLES), "angle"),
}
"""Meaning of a column -> its quantity; other columns have no unit."""
# meanings that are kept; columns with other names are ignored
_MEANINGS = {"id", "t", "frame", *POSITION, *(name for names in ROTATIONS for name in names)}
# other spelling of a meaning -> the meaning; m00 to m22 count from 0, r11 to r33 from 1
_SYNONYMS = {
    **dict.fromkeys(("object", "object_id", "part", "name", "track", "track_id", "body", "child_frame_id"), "id"),
    **dict.fromkeys(("time", "timestamp", "stamp"), "t"),
    **{f"{letter}{axis}": axis for letter in ("t", "p", "pos_") for axis in "xyz"},
    **{f"m{i}{j}": f"r{i + 1}{j + 1}" for i in range(3) for j in range(3)},
    **{f"rot_{axis}": f"r{axis}" for axis in "xyz"},
    **{f"q_{axis}": f"q{axis}" for axis in "wxyz"},
}


class LogColumn(NamedTuple):
    """The meaning of a column, and the unit that its name states, or an empty text."""

    meaning: str
    unit: str = ""


_ROS_FIELDS = {
    **{f"{kind}.{axis}": LogColumn(axis, "m") for kind in ("position", "translation") for axis in "xyz"},
    **{f"{kind}.{axis}": LogColumn(f"q{axis}") for kind in ("orientation", "rotation") for axis in "wxyz"},
    **dict.fromkeys(("stamp.sec", "stamp.secs"), LogColumn("seconds")),
    **dict.fromkeys(("stamp.nanosec", "stamp.nsecs"), LogColumn("nanoseconds")),
    "header.stamp": LogColumn("stamp"),
}
"""Last two names of a field of a ROS message -> its meaning, as in `/vision/pose/position/x`."""


def find_column(name: str) -> LogColumn | None:
    """Return the meaning of a column with this name; None for a column that is ignored."""
    *path, name = re.split(r"[./]", name.strip().lower())
    if path and name != "child_frame_id":
        return _ROS_FIELDS.get(f"{path[-1]}.{name}")
    stem, _, unit = name.rpartition("_")
    if not any(unit in factors for factors in UNITS.values()):  # the last word is no unit
        stem = name
        unit = ""
    meaning = _SYNONYMS.get(stem, stem)
    return LogColumn(meaning, unit) if meaning in _MEANINGS else None
