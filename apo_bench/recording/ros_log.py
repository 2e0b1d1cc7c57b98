"""Logs exported from ROS bags: PoseStamped and TransformStamped, as CSV or as JSON; metres, quaternions x, y, z, w."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, one_line
from apo_bench.geometry import pose
from apo_bench.io.ordinary_files import decoded, read_bytes
from apo_bench.recording.camera_file import Conventions
from apo_bench.recording.columns import LogColumn, check_length, poses
from apo_bench.recording.csv_log import read_numbers
from apo_bench.recording.log import LARGEST_LOG_BYTES, MOST_POSES, LogRows

_FIELDS = {
    **{f"{kind}.{axis}": LogColumn(axis, "m") for kind in ("position", "translation") for axis in "xyz"},
    **{f"{kind}.{axis}": LogColumn(f"q{axis}", "") for kind in ("orientation", "rotation") for axis in "wxyz"},
    **{name: LogColumn("seconds", "s") for name in ("stamp.sec", "stamp.secs")},
    **{name: LogColumn("nanoseconds", "ns") for name in ("stamp.nanosec", "stamp.nsecs")},
    "stamp": LogColumn("stamp", "ns"),
    "time": LogColumn("time", ""),
    "child_frame_id": LogColumn("id", ""),
}
_NOTES = ["lengths in m, as in ROS", "quaternions by the names of the fields, as in ROS"]


def read_ros_csv(path: Path, how: Conventions) -> tuple[LogRows, list[str]]:
    """Columns such as `field.header.stamp`, `pose.position.x`; without child_frame_id one file is one object.

    A stamp in one column is in nanoseconds if it is whole, as ROS writes it, else in seconds.
    """
    table = read_numbers(path, _field, how.columns)
    cells = dict(table.cells)
    if "seconds" in cells:
        t = cells["seconds"] + 1e-9 * cells.get("nanoseconds", np.zeros(len(cells["seconds"])))
    elif "stamp" in cells or "time" in cells:
        t = cells["stamp"] if "stamp" in cells else cells["time"]
        t = t * 1e-9 if (t == np.round(t)).all() else t
    else:
        raise InputError(f"{path}: the column of the time is missing, such as header.stamp.sec; export the header too.")
    places = [f"{path}, line {line}" for line in table.lines]
    T, _ = poses(cells, table.units, how, str(path), places)
    return LogRows(table.ids, t, T, places), _NOTES


def read_ros_json(path: Path, how: Conventions) -> tuple[LogRows, list[str]]:
    """A list of messages, or one message per line; a topic names the object where there is no child_frame_id."""
    ids = list[str]()
    t = list[float]()
    packed = list[list[float]]()
    places = list[str]()
    for place, message in _messages(path):
        for stamped in _stamped(message):
            if len(ids) == MOST_POSES:
                raise InputError(f"{place}: a log of at most {MOST_POSES:,} poses is needed; cut it.")
            ids.append(stamped.get("child_frame_id") or message.get("topic") or path.stem)
            t.append(_stamp(stamped, place))
            packed.append(_pose(stamped, place))
            places.append(place)
    numbers = np.array(packed).reshape(-1, 7)
    check_length(numbers[:, 3:], "a quaternion", places)
    return LogRows([str(name).strip("/") for name in ids], np.array(t), pose.unpack(numbers), places), _NOTES


def _field(name: str) -> LogColumn | None:
    """What a column is, by the last names in it: `field.pose.position.x`, `/vision/pose/position/x`."""
    words = re.split(r"[./]", name.strip().lower().lstrip("%"))
    return _FIELDS.get(".".join(words[-2:])) or _FIELDS.get(words[-1])


def _messages(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    text = decoded(read_bytes(path, "log", LARGEST_LOG_BYTES), str(path), "log")
    if not text.strip():
        raise InputError(f"{path}: the file is empty; a list of messages is needed, or one message per line.")
    by_line = not text.lstrip().startswith("[")
    for line, part in enumerate(text.splitlines() if by_line else [text], start=1):
        if not part.strip():
            continue
        try:
            document = json.loads(part)
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}, line {line}: this is not JSON ({str(error)[:80]}).") from error
        for i, message in enumerate(document if isinstance(document, list) else [document], start=1):
            place = f"{path}, line {line}" if by_line else f"{path}, message {i}"
            if not isinstance(message, dict):
                raise InputError(f"{place}: a message with named fields is needed.")
            yield place, message


def _stamped(message: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The poses in a message: its own, those of a TFMessage, or those of what it wraps."""
    for key in ("msg", "message", "data"):
        if isinstance(message.get(key), dict):
            yield from _stamped(message[key])
            return
    transforms = message.get("transforms")
    yield from (
        (stamped for stamped in transforms if isinstance(stamped, dict)) if isinstance(transforms, list) else [message]
    )


def _stamp(message: dict[str, Any], place: str) -> float:
    stamp = message.get("header", {}).get("stamp") if isinstance(message.get("header"), dict) else None
    if isinstance(stamp, dict):
        whole = stamp.get("sec", stamp.get("secs"))
        part = stamp.get("nanosec", stamp.get("nsecs", 0))
        return _finite(whole, f"{place}, header.stamp.sec") + 1e-9 * _finite(part, f"{place}, header.stamp.nanosec")
    x = _finite(stamp, f"{place}, header.stamp")
    return x * 1e-9 if x.is_integer() else x


def _pose(message: dict[str, Any], place: str) -> list[float]:
    """(x, y, z, qw, qx, qy, qz), [m]."""
    inside: Any = message.get("pose", message.get("transform"))
    if isinstance(inside, dict) and isinstance(inside.get("pose"), dict):
        inside = inside["pose"]
    if not isinstance(inside, dict):
        raise InputError(f"{place}: a field `pose` or `transform` is needed.")
    at = inside.get("position", inside.get("translation"))
    turn = inside.get("orientation", inside.get("rotation"))
    if not isinstance(at, dict) or not isinstance(turn, dict):
        raise InputError(f"{place}: a position with an orientation is needed, or a translation with a rotation.")
    return [_finite(at.get(k), f"{place}, {k}") for k in "xyz"] + [
        _finite(turn.get(k), f"{place}, {k}") for k in "wxyz"
    ]


def _finite(x: Any, place: str) -> float:
    if isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e20:
        return float(x)
    raise InputError(f"{place}: a finite number is needed, '{one_line(str(x), 40)}' was given.")
