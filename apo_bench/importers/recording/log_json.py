"""Read JSON logs as tables: ROS messages, detections of objects and of AprilTags, MegaPose, and truth of BOP scenes.

Poses are found wherever they stand; time, image, id, score and validity are those of the innermost object around.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.importers.recording.log_columns import MATRIX, SHARED, find_column
from apo_bench.importers.recording.log_tables import LARGEST_LOG_BYTES, LogTable
from apo_bench.io import read_text

_POSITIONS = ("position", "translation", "pose_t", "tvec", "cam_t_m2c", "trans", "t", "xyz")
_ROTATIONS = (
    "orientation",
    "rotation",
    "pose_R",
    "cam_R_m2c",
    "rvec",
    "quaternion",
    "quat",
    "rotation_matrix",
    "R",
    "q",
)
_MATRICES = (
    "matrix",
    "pose",
    "transform",
    "T",
    "ob_in_cam",
    "pose_matrix",
    "TCO",
    "T_cam_obj",
    "T_cam_object",
    "cam_T_obj",
)
_PAIRS = ("TWO", "TCO")  # quaternion xyzw and position, as MegaPose writes them
_AROUND = ("header", "stamp", "hypothesis", "msg", "message", "data")  # their fields count for the object around them
_NO_POSES = ("bbox", "camera", "covariance", "twist", "camera_params", "corners", "center")
_IDS = ("child_frame_id", "class_id", "tag_id", "obj_id", "object_id", "label", "name", "id", "object", "topic")


def read_json_tables(path: Path) -> list[LogTable]:
    """Read a JSON document, or one document per line.

    Raises:
        InputError: The file is no JSON, or no pose stands in it.
    """
    by_names: dict[tuple[str, ...], list[tuple[list[Any], str]]] = {}
    for place, document in _list_documents(path):
        for fields in _walk(document, {}):
            names = tuple(sorted(fields))
            by_names.setdefault(names, []).append(([fields[name] for name in names], place))
    require(by_names, f"{path}: no pose is found: a position and an orientation, a rotation or a 4 x 4 matrix.")
    tables = []
    for names, rows in by_names.items():
        cells = zip(*(row for row, _ in rows), strict=True)
        known = [(column, own) for name, own in zip(names, cells, strict=True) if (column := find_column(name))]
        columns = {column.meaning: column for column, _ in known}
        own_cells = {column.meaning: own for column, own in known}
        tables.append(LogTable(path, "JSON", path.stem, columns, own_cells, [place for _, place in rows]))
    return tables


def _list_documents(path: Path) -> list[tuple[str, Any]]:
    """Return each document with its location in the file."""
    text = read_text(path, "log", LARGEST_LOG_BYTES)
    lines = [(f"{path}, line {i}", line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    try:
        try:
            return [(str(path), json.loads(text))]
        except ValueError:
            if len(lines) < 2:
                raise
            return [(place, json.loads(line)) for place, line in lines]
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: this is not JSON ({str(error)[:80]}); give one document, or one a line.") from error


def _walk(value: Any, around: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the fields of every pose in a document: name of a column -> value."""
    if isinstance(value, list):
        for each in value:
            yield from _walk(each, around)
        return
    if not isinstance(value, dict):
        return
    around = {**around, **_shared_fields(value)}
    pose = _pose_fields(value)
    if pose is not None:
        yield {**around, **pose}
        return
    results = value.get("results")
    if isinstance(results, list) and len(results) > 1:  # hypotheses on one object: the best counts
        value = {**value, "results": [max(results, key=lambda each: _shared_fields(each).get("score", 0.0))]}
    for key, inner in value.items():
        if key not in _NO_POSES:
            number = {"frame": int(key)} if key.isdigit() else {}
            yield from _walk(inner, {**around, **number})


def _shared_fields(value: Mapping[str, Any]) -> dict[str, Any]:
    """Return time, image, id, score and validity that an object states, by the names of their columns."""
    found: dict[str, Any] = {}
    for key in _AROUND:
        if isinstance(value.get(key), dict):
            found |= {name: x for name, x in _shared_fields(value[key]).items() if name != "id" or key != "data"}
    for key in reversed(_IDS):
        own = value.get(key)
        own = own[0] if isinstance(own, list) and len(own) == 1 else own
        if isinstance(own, str | int) and not isinstance(own, bool) and own != "":
            found["id"] = str(own).strip("/")
    for key, own in value.items():
        column = find_column(key)
        is_shared = column is not None and not column.of and column.meaning in SHARED and column.meaning != "id"
        if column is not None and is_shared and isinstance(own, int | float):
            found[f"{column.meaning}_{column.unit}" if column.unit else column.meaning] = own
    return found


def _pose_fields(value: Mapping[str, Any]) -> dict[str, float] | None:
    """Return the pose that an object states, as columns of a table; NaN for a pose that is null."""
    for key in _PAIRS:
        pair = value.get(key)
        if isinstance(pair, list) and len(pair) == 2 and [np.size(x) for x in pair] == [4, 3]:
            return {**dict(zip(("qx", "qy", "qz", "qw"), pair[0], strict=True)), **_position(pair[1], "m")}
    at = next((key for key in _POSITIONS if _size(value.get(key)) == 3), None)
    turn = next((key for key in _ROTATIONS if _size(value.get(key)) in (3, 4, 9)), None)
    if at is not None and turn is not None:
        unit = "mm" if at == "cam_t_m2c" else "m" if isinstance(value[at], dict) or at == "pose_t" else ""
        return {**_rotation(value[turn]), **_position(value[at], unit)}
    for key in _MATRICES:
        if _size(value.get(key)) in (12, 16):
            M = np.array(_numbers(value[key]))[:12].reshape(3, 4)
            return {**dict(zip(MATRIX, M[:, :3].ravel().tolist(), strict=True)), **_position(M[:, 3].tolist(), "")}
        if key in value and value[key] is None:
            return {**dict.fromkeys(MATRIX, np.nan), **_position([np.nan] * 3, "m")}
    return None


def _size(value: Any) -> int:
    """Return how many numbers a field holds; 0 if it holds anything else."""
    return len(_numbers(value))


def _numbers(value: Any) -> list[float]:
    """Return the numbers of a list, of lists of lists, or of an object with x, y, z and perhaps w; NaN for null."""
    if isinstance(value, dict):
        value = [value[name] for name in "xyzw" if name in value]
    try:
        return np.array(value, dtype=np.float64).ravel().tolist() if isinstance(value, list) else []
    except (TypeError, ValueError):
        return []


def _position(value: Any, unit: str) -> dict[str, float]:
    """Return a position as columns with a unit."""
    return dict(zip((f"{axis}_{unit}" if unit else axis for axis in "xyz"), _numbers(value), strict=True))


def _rotation(value: Any) -> dict[str, float]:
    """Return a rotation as columns: a matrix, a named quaternion, four numbers, or a rotation vector in radians."""
    numbers = _numbers(value)
    quaternion = ("qx", "qy", "qz", "qw") if isinstance(value, dict) else ("q0", "q1", "q2", "q3")
    names = {9: MATRIX, 3: ("rx_rad", "ry_rad", "rz_rad"), 4: quaternion}[len(numbers)]
    return dict(zip(names, numbers, strict=True))
