"""The formats of logs, and the one that reads them all."""

import json
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.files.bop import read_results
from apo_bench.geometry import pose
from apo_bench.io import decoded, read_bytes
from apo_bench.recording.columns import check_length, oriented
from apo_bench.recording.csv_log import ROS_NOTES, read_csv_log, read_ros_csv, read_tum
from apo_bench.recording.log import LARGEST_LOG_BYTES, MOST_POSES, Log, LogRows, checked_log
from apo_bench.recording.setup_files import Conventions

Reader = Callable[[Path, Conventions], LogRows]


def read_log(path: str | Path, form: str, how: Conventions) -> Log:
    """A log in one of `FORMATS`, in metres and right-handed axes, camera from model.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    require_known("format", form, FORMATS)
    path = Path(path)
    read, endings = FORMATS[form]
    require(not path.is_dir() or endings, f"{path}: a folder was given; a log of the format {form} is one file.")
    # Of a folder each file is one object.
    files = sorted(file for ending in endings for file in path.glob(f"*{ending}")) if path.is_dir() else [path]
    require(files, f"{path}: the folder holds no file that ends in {' or '.join(endings)}; give a folder of logs.")
    ids, t, T, places, notes = zip(*(read(file, how) for file in files), strict=True)
    poses, more = oriented(np.concatenate(T), how)
    rows = LogRows([*chain(*ids)], np.concatenate(t), poses, [*chain(*places)], [*notes[0], *more])
    return checked_log(str(path), rows)


def _bop(path: Path, how: Conventions) -> LogRows:
    """BOP results: mm, rotation matrices, images by number; of several estimates of one object the best score."""
    results = read_results(path)
    scenes = np.unique(results.where[:, 0])
    scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
    require(
        scene is not None and scene in scenes,
        f"{path}: a recording is one scene, and the file holds {', '.join(map(str, scenes[:6].tolist()))}; state "
        "`scene` in the camera file.",
    )
    require(
        how.rate_hz is not None, f"{path}: images are numbered and have no time; state `rate_hz` in the camera file."
    )
    # Rows of the scene by image and object, the best score first; of rows of one image and object the first is kept.
    at = np.flatnonzero(results.where[:, 0] == scene)
    at = at[np.lexsort((-results.score[at], results.where[at, 2], results.where[at, 1]))]
    again = (results.where[at[1:], 1:] == results.where[at[:-1], 1:]).all(axis=1)
    at = at[np.concatenate([[True], ~again])]
    T = np.tile(np.eye(4), (len(at), 1, 1))
    T[:, :3, :3] = pose.nearest_rotations(results.R[at])
    T[:, :3, 3] = results.t_mm[at] * 1e-3
    left = f"; {int(again.sum())} estimates of lower score left out" if again.any() else ""
    return LogRows(
        ids=[str(k) for k in results.where[at, 2]],
        t=results.where[at, 1] / how.rate_hz,
        T=T,
        places=[results.spot(int(i)) for i in at],
        notes=["lengths in mm, as in BOP", f"rotation matrices, row by row, at {how.rate_hz:g} images a second{left}"],
    )


def _ros_json(path: Path, how: Conventions) -> LogRows:
    """A list of messages, or one message per line; a topic names the object where there is no child_frame_id."""
    ids = list[str]()
    t = list[float]()
    packed = list[list[float]]()
    places = list[str]()
    for place, message in _messages(path):
        for stamped in _stamped(message):
            require(len(ids) != MOST_POSES, f"{place}: a log of at most {MOST_POSES:,} poses is needed; cut it.")
            ids.append(str(stamped.get("child_frame_id") or message.get("topic") or path.stem).strip("/"))
            t.append(_stamp(stamped, place))
            packed.append(_pose(stamped, place))
            places.append(place)
    numbers = np.array(packed).reshape(-1, 7)
    check_length(numbers[:, 3:], "a quaternion", places)
    return LogRows(ids, np.array(t), pose.unpack(numbers), places, ROS_NOTES)


def _messages(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    text = decoded(read_bytes(path, "log", LARGEST_LOG_BYTES), str(path), "log")
    require(text.strip(), f"{path}: the file is empty; a list of messages is needed, or one message per line.")
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


def _stamped(message: dict[str, Any]) -> list[dict[str, Any]]:
    """The poses in a message: its own, those of a TFMessage, or those of what it wraps."""
    wrapped = _inner(message, "msg", "message", "data")
    if wrapped:
        return _stamped(wrapped)
    transforms = message.get("transforms")
    return [each for each in transforms if isinstance(each, dict)] if isinstance(transforms, list) else [message]


def _inner(message: dict[str, Any], *keys: str) -> dict[str, Any]:
    """The first of some fields that has fields itself; else none."""
    return next((message[key] for key in keys if isinstance(message.get(key), dict)), {})


def _stamp(message: dict[str, Any], place: str) -> float:
    stamp = _inner(message, "header").get("stamp")
    if isinstance(stamp, dict):
        whole = stamp.get("sec", stamp.get("secs"))
        part = stamp.get("nanosec", stamp.get("nsecs", 0))
        return _finite(whole, f"{place}, header.stamp.sec") + 1e-9 * _finite(part, f"{place}, header.stamp.nanosec")
    x = _finite(stamp, f"{place}, header.stamp")
    return x * 1e-9 if x.is_integer() else x


def _pose(message: dict[str, Any], place: str) -> list[float]:
    """(x, y, z, qw, qx, qy, qz), [m]."""
    inside = _inner(message, "pose", "transform")
    require(inside, f"{place}: a field `pose` or `transform` is needed.")
    inside = _inner(inside, "pose") or inside
    at = _inner(inside, "position", "translation")
    turn = _inner(inside, "orientation", "rotation")
    require(at and turn, f"{place}: a position with an orientation is needed, or a translation with a rotation.")
    return [_finite(fields.get(k), f"{place}, {k}") for fields, keys in ((at, "xyz"), (turn, "wxyz")) for k in keys]


def _finite(x: Any, place: str) -> float:
    if isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e20:
        return float(x)
    raise InputError(f"{place}: a finite number is needed, '{one_line(str(x), 40)}' was given.")


FORMATS: Mapping[str, tuple[Reader, tuple[str, ...]]] = MappingProxyType(
    {
        "csv": (read_csv_log, (".csv",)),
        "bop": (_bop, ()),
        "tum": (read_tum, (".txt", ".tum")),
        "ros-csv": (read_ros_csv, (".csv",)),
        "ros-json": (_ros_json, (".json", ".jsonl")),
    }
)
"""Name -> its reader, and how the files of a folder end that holds one for each object."""
