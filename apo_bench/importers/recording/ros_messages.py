"""Poses as messages of ROS in JSON: a list of them, or one per line."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.columns import Numbers
from apo_bench.importers.recording.row_logs import LARGEST_LOG_BYTES, finite_numbers, ros_field, ros_rows
from apo_bench.importers.recording.tracks import LogRows
from apo_bench.io import read_text

_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def read_ros_json(path: Path, how: Conventions) -> LogRows:
    """Messages, or what wraps them; a topic names the object where there is no child_frame_id."""
    ids = list[str]()
    places = list[str]()
    columns: dict[str, list[Any]] = {}
    for place, message in _messages(path):
        for fields in _poses_in(message):
            if not ids:
                columns = {name: [] for name in fields if name != "id"}
            require(
                {*columns, "id"} == {*fields, "id"} and set(_POSE) <= set(fields),
                f"{place}: a field `pose` with position and orientation is needed, or `transform` with translation "
                "and rotation, and a header as in the other messages.",
            )
            ids.append(str(fields.pop("id", None) or message.get("topic") or path.stem).strip("/"))
            places.append(place)
            for name, values in columns.items():
                values.append(fields[name])
    cells = {name: finite_numbers(values, places, f", {name}") for name, values in columns.items()}
    return ros_rows(Numbers(str(path), cells, dict.fromkeys("xyz", "m"), ids, places), how)


def _messages(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    text = read_text(path, "log", LARGEST_LOG_BYTES)
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
            require(isinstance(message, dict), f"{place}: a message with named fields is needed.")
            yield place, message


def _poses_in(message: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """What each pose in a message says by its fields: the message's own, or those of a TFMessage in it."""
    inner = [value for key, value in message.items() if key in ("msg", "message", "data") and isinstance(value, dict)]
    transforms = message.get("transforms")
    if inner:
        yield from _poses_in(inner[0])
    elif isinstance(transforms, list):
        for each in transforms:
            yield from _poses_in(each if isinstance(each, dict) else {})
    else:
        named = ((ros_field(name), value) for name, value in _flatten(message, ""))
        yield {column.meaning: value for column, value in named if column is not None}


def _flatten(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flatten(inner, f"{name}.{key}" if name else key)
    else:
        yield name, value
