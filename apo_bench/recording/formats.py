"""The formats of logs, and the one that reads them all.

Logs of one line per pose: columns known by their names, as exported from ROS bags, and as TUM has them.
"""

import csv
import json
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.files.bop import read_results
from apo_bench.geometry import Array, pose
from apo_bench.io import check_separator, decoded, opened, read_bytes
from apo_bench.recording.columns import LogColumn, check_length, column, oriented, poses, row_times
from apo_bench.recording.setup_files import LARGEST_LOG_BYTES, MOST_POSES, Conventions, Log, LogRows, checked_log

_LONGEST_LINE = 16384
_LARGEST = 1e20
_FIELDS = {
    **{f"{kind}.{axis}": LogColumn(axis, "m") for kind in ("position", "translation") for axis in "xyz"},
    **{f"{kind}.{axis}": LogColumn(f"q{axis}", "") for kind in ("orientation", "rotation") for axis in "wxyz"},
    **{name: LogColumn("seconds", "s") for name in ("stamp.sec", "stamp.secs")},
    **{name: LogColumn("nanoseconds", "ns") for name in ("stamp.nanosec", "stamp.nsecs")},
    "stamp": LogColumn("stamp", "ns"),
    "time": LogColumn("time", ""),
    "child_frame_id": LogColumn("id", ""),
}
ROS_NOTES = ["lengths in m, as in ROS", "quaternions by the names of the fields, as in ROS"]


class Numbers(NamedTuple):
    """A table as it stands in a file, with the unit in the name of each column."""

    cells: Mapping[str, Array]
    units: Mapping[str, str]
    ids: Sequence[str]
    places: Sequence[str]
    """`file, line 3` of each row."""


def read_csv_log(path: Path, how: Conventions) -> LogRows:
    """The rows of a file whose columns name what they are; without a column of ids, its name is the id of all."""
    cells, units, ids, places = read_numbers(path, column, how.columns)
    T, notes = poses(cells, units, how, str(path), places)
    if "t" not in cells and "frame" not in cells:
        notes = [*notes, f"times counted from images, {how.rate_hz or 0:g} a second"]
    return LogRows(ids, row_times(cells, units, how, str(path), ids), T, places, notes)


def read_ros_csv(path: Path, how: Conventions) -> LogRows:
    """Columns such as `field.header.stamp`, `pose.position.x`; without child_frame_id one file is one object.

    A stamp in one column is in nanoseconds if it is whole, as ROS writes it, else in seconds.
    """
    cells, units, ids, places = read_numbers(path, _field, how.columns)
    if "seconds" in cells:
        t = cells["seconds"] + 1e-9 * cells.get("nanoseconds", np.zeros(len(cells["seconds"])))
    elif "stamp" in cells or "time" in cells:
        t = cells["stamp"] if "stamp" in cells else cells["time"]
        t = t * 1e-9 if (t == np.round(t)).all() else t
    else:
        raise InputError(f"{path}: the column of the time is missing, such as header.stamp.sec; export the header too.")
    return LogRows(ids, t, poses(cells, units, how, str(path), places)[0], places, ROS_NOTES)


def read_tum(path: Path, how: Conventions) -> LogRows:
    """`timestamp tx ty tz qx qy qz qw` with spaces between, m; the name of the file is the id."""
    numbers = dict[str, list[float]]()
    for line, words in text_lines(path, separator=None):
        place = f"{path}, line {line}"
        require(
            len(words) == 8 or words[0].startswith("#"),
            f"{place}: eight numbers with spaces between them are needed, timestamp tx ty tz qx qy qz qw; "
            f"'{one_line(' '.join(words), 40)}' was given.",
        )
        if not words[0].startswith("#"):
            numbers[place] = [finite_number(word, place) for word in words]
    require(numbers, f"{path}: no pose stands in the file; lines of timestamp tx ty tz qx qy qz qw are needed.")
    cells = np.array([*numbers.values()])
    check_length(cells[:, 4:], "a quaternion", [*numbers])
    return LogRows(
        ids=[path.stem] * len(cells),
        t=cells[:, 0],
        T=pose.unpack(cells[:, [1, 2, 3, 7, 4, 5, 6]]),
        places=[*numbers],
        notes=["lengths in m, as in TUM", "quaternions x, y, z, w, as in TUM"],
    )


def read_numbers(path: Path, meaning: Callable[[str], LogColumn | None], renamed: Mapping[str, str]) -> Numbers:
    """The columns of a file that mean something.

    Args:
        renamed: Column of the file -> a name that means something.
    """
    lines = text_lines(path)
    first, names = next(lines, (0, []))
    require(names, f"{path}: the file is empty; its first line names the columns, such as t_s,id,x_mm,y_mm,z_mm.")
    place = f"{path}, line {first}"
    check_separator(place, names)
    there = {name.strip().lower() for name in names}
    for theirs, ours in renamed.items():
        require_known("column", theirs, there, place=f"{path}: the camera file, log.columns, {ours}")
        require(
            meaning(ours) is not None,
            f"{path}: the camera file, log.columns: '{one_line(ours, 40)}' means nothing here; allowed are names "
            "of columns such as id, t_s, x_mm, qw.",
        )
    known = [meaning(renamed.get(name.strip().lower(), name)) for name in names]
    columns = {i: each for i, each in enumerate(known) if each is not None}
    number = next((name for name in names if is_number(name)), None)
    require(
        columns or number is None,
        f"{place}: the names of columns are needed, such as t_s,id,x_mm, and the number {one_line(str(number), 40)} "
        "was given; let the log begin with a line of names.",
    )
    for name, count in Counter(each.meaning for each in columns.values()).items():
        require(count <= 1, f"{place}: two columns say '{name}'; keep one, or name the other one otherwise.")
    of_id = next((i for i, each in columns.items() if each.meaning == "id"), None)
    cells = {i: array("d") for i in columns if i != of_id}
    ids = list[str]()
    places = list[str]()
    for line, texts in lines:
        places.append(f"{path}, line {line}")
        require(
            len(texts) == len(names),
            f"{places[-1]}: {len(names)} cells are needed, as many as line {first} has, which is read as the names of "
            f"columns; {len(texts)} were given. Let the log begin with the line of names, and leave out broken rows.",
        )
        require(len(places) <= MOST_POSES, f"{places[-1]}: a log of at most {MOST_POSES:,} rows is needed; cut it.")
        for i, column_cells in cells.items():
            column_cells.append(finite_number(texts[i], f"{places[-1]}, column {one_line(names[i], 40)}"))
        ids.append(path.stem if of_id is None else texts[of_id])
    return Numbers(
        {columns[i].meaning: np.array(column_cells) for i, column_cells in cells.items()},
        {each.meaning: each.unit for each in columns.values()},
        ids,
        places,
    )


def _field(name: str) -> LogColumn | None:
    """What a column is, by the last names in it: `field.pose.position.x`, `/vision/pose/position/x`."""
    words = re.split(r"[./]", name.strip().lower().lstrip("%"))
    return _FIELDS.get(".".join(words[-2:])) or _FIELDS.get(words[-1])


def is_number(text: str) -> bool:
    """Whether a cell can be read as a number."""
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def finite_number(text: str, place: str) -> float:
    """A finite number."""
    try:
        x = float(text) if "_" not in text else np.nan
    except ValueError:
        x = np.nan
    if not abs(x) <= _LARGEST:
        raise InputError(f"{place}: a finite number is needed, '{one_line(text, 40)}' was given; leave out such rows.")
    return x


def text_lines(path: Path, separator: str | None = ",") -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not empty; None separates by spaces."""
    size = 0
    with opened(path, "log") as stream:
        for line, raw in enumerate(iter(lambda: stream.readline(_LONGEST_LINE + 1), b""), start=1):
            size += len(raw)
            require(
                len(raw) <= _LONGEST_LINE,
                f"{path}, line {line}: a line of at most {_LONGEST_LINE} characters is needed.",
            )
            require(
                size <= LARGEST_LOG_BYTES,
                f"{path}: the file is larger than {LARGEST_LOG_BYTES / 1e6:g} MB; cut the log.",
            )
            try:
                text = raw.decode("utf-8-sig" if line == 1 else "utf-8")
            except UnicodeDecodeError as error:
                raise InputError(f"{path}, line {line}: this is not UTF-8 text; give a log as text.") from error
            if text.strip():
                words = next(csv.reader([text])) if separator and '"' in text else text.split(separator)
                yield line, [word.strip() for word in words]


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
    require(
        files,
        f"{path}: the folder itself holds no file that ends in {' or '.join(endings)}; give a folder with one file for "
        "each object.",
    )
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
