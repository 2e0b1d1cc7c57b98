"""Recognise what a column of a log holds, its unit, and the object it is of, from its name."""

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    "angle": {"deg": np.pi / 180.0, "rad": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
}
"""Quantity -> unit -> factor to m, rad or s."""
_SPELLED = {
    **dict.fromkeys(("millimeters", "millimetres", "millimeter"), "mm"),
    **dict.fromkeys(("centimeters", "centimetres"), "cm"),
    **dict.fromkeys(("meters", "metres", "meter"), "m"),
    **dict.fromkeys(("degrees", "degree"), "deg"),
    **dict.fromkeys(("radians", "radian"), "rad"),
    **dict.fromkeys(("seconds", "second", "sec", "secs"), "s"),
    **dict.fromkeys(("milliseconds", "msec"), "ms"),
    **dict.fromkeys(("nanoseconds", "nanosec", "nsec"), "ns"),
}
"""Other spelling of a unit -> the unit."""
POSITION = ("x", "y", "z")  # meanings of columns, here and below
QUATERNION = ("qw", "qx", "qy", "qz")
NUMBERED_QUATERNION = ("q0", "q1", "q2", "q3")  # the camera file states their order
ROTATION_VECTOR = ("rx", "ry", "rz")
AXIS_AND_ANGLE = ("ax", "ay", "az", "angle")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
EULER_ANGLES = ("roll", "pitch", "yaw")
NUMBERED_EULER_ANGLES = ("e1", "e2", "e3")  # about the axes that `euler` of the camera file states
# Of several complete rotations of a log, the first of these counts.
ROTATIONS = (
    QUATERNION,
    NUMBERED_QUATERNION,
    MATRIX,
    ROTATION_VECTOR,
    AXIS_AND_ANGLE,
    EULER_ANGLES,
    NUMBERED_EULER_ANGLES,
)
QUANTITIES: Mapping[str, str] = {
    "t": "time",
    **dict.fromkeys(POSITION, "length"),
    **dict.fromkeys(("angle", *ROTATION_VECTOR, *EULER_ANGLES, *NUMBERED_EULER_ANGLES), "angle"),
}
"""Meaning of a column -> its quantity; other columns have no unit."""
SHARED = ("id", "t", "sec", "nanosec", "frame", "scene", "valid", "lost", "score")
"""Meanings of columns that may belong to all objects of a row."""

_PATTERNS: tuple[tuple[str, str], ...] = (
    (
        r"id|object|object_?id|obj_?id|part|name|track|track_?id|tag_?id|marker_?id|body|rigid_?body|label|class_?id|"
        r"child_frame_id|object_?name",
        "id",
    ),
    (r"t|time|times|timestamp|time_?stamp|__time|ts|header\.stamp|stamp|elapsed", "t"),
    (r"(?:(?:header\.)?stamp\.)?secs?", "sec"),
    (r"(?:header\.)?stamp\.(?:nanosec|nsecs?)|nsecs|nanosec", "nanosec"),
    (r"frame|frame_?id|frame_?(?:number|index|idx|no)|image|image_?id|im_?id|img_?id", "frame"),
    (r"scene|scene_?id", "scene"),
    (r"(?:is_?|tracking_?|pose_?)?valid|(?:is_?)?(?:tracked|detected|visible|found)|success", "valid"),
    (r"(?:is_?)?(?:lost|occluded|missing|hidden)", "lost"),
    (r"score|confidence", "score"),
    (r"(?:t|p|pos|position|trans|translation|tvec|location|p_rs_r)?[._ ]?([xyz])", "{}"),
    (r"(?:q|quat|quaternion|orientation|rotation|q_rs)[._ ]?([wxyz])", "q{}"),
    (r"(?:q|quat|quaternion)_?([0-3])", "q{}"),
    (r"(?:r|rot|rvec|rotvec|rotation_vector)[._ ]?([xyz])", "r{}"),
    (r"(?:a|axis)[._ ]?([xyz])", "a{}"),
    (r"(?:r|rot|rotation)_?([123])_?([123])", "r{}{}"),
    (r"(angle|roll|pitch|yaw|e[123])", "{}"),
)
"""Pattern of the last words of a name -> meaning."""
_COUNTED_FROM_0 = re.compile(r"(.*?)(?:m|rot|r|rotation)_?([0-2])_?([0-2])")


class LogColumn(NamedTuple):
    """The meaning of a column, the unit that its name states, or an empty text, and the object before it."""

    meaning: str
    unit: str = ""
    of: str = ""
    """What stands before the meaning, such as `/tracker/stick/pose`."""


@lru_cache(maxsize=4096)
def find_column(name: str, from_zero: bool = False) -> LogColumn | None:
    """Return the meaning of a column with this name; None for a column that is ignored.

    Args:
        from_zero: Whether elements of matrices are counted from 0.
    """
    text = name.strip().strip('"').lower().lstrip("#%/ ")
    stated = re.search(r"\s*[\[(]([^\])]*)[\])]$", text)  # a unit in brackets
    unit = ""
    if stated:
        text, unit = text[: stated.start()], _SPELLED.get(stated[1].strip(), stated[1].strip())
    else:
        stem, _, last = text.rpartition("_")
        last = _SPELLED.get(last, last)
        if stem and any(last in factors for factors in UNITS.values()) and not text.endswith(("stamp_sec", "nanosec")):
            text, unit = stem, last
    text = text.replace("/", ".").replace(":", ".")
    if from_zero and (match := _COUNTED_FROM_0.fullmatch(text)):
        return LogColumn(f"r{int(match[2]) + 1}{int(match[3]) + 1}", of=match[1].rstrip("._ "))
    matches = [(re.fullmatch(rf"(.*?[._ ])??(?:{pattern})", text), meaning) for pattern, meaning in _PATTERNS]
    found = [(match, meaning) for match, meaning in matches if match]
    if not found:
        return None
    # The pattern that explains most of the name counts.
    match, meaning = min(found, key=lambda each: len(each[0][1] or ""))
    meaning = meaning.format(*match.groups()[1:])
    of = (match[1] or "").rstrip("._ ")
    if meaning == "frame" and of.endswith("header"):  # the name of a coordinate frame
        return None
    if not unit and re.search(r"(position|translation)\.[xyz]$", text):
        unit = "m"  # a field of a ROS message
    return LogColumn(meaning, unit if unit in UNITS.get(QUANTITIES.get(meaning, ""), {}) else "", of)
