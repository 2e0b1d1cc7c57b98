"""Logs of one line per pose: columns known by their names, as exported from ROS bags, and as TUM has them."""

import csv
import io
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.columns import LogColumn, Numbers, check_length, column, read_poses, row_times
from apo_bench.importers.recording.tracks import LogRows
from apo_bench.io import check_separator, read_text

LARGEST_LOG_BYTES = 200_000_000
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


def read_csv_log(path: Path, how: Conventions) -> LogRows:
    """The rows of a file whose columns name what they are; without a column of ids, its name is the id of all."""
    numbers = _read_numbers(path, column, how.columns)
    T, notes = read_poses(numbers, how)
    if "t" not in numbers.cells and "frame" not in numbers.cells:
        notes = [*notes, f"times counted from images, {how.rate_hz or 0:g} a second"]
    return LogRows(numbers.ids, row_times(numbers, how), T, numbers.places, notes)


def read_ros_csv(path: Path, how: Conventions) -> LogRows:
    """Columns such as `field.header.stamp`, `pose.position.x`; without child_frame_id one file is one object."""
    return ros_rows(_read_numbers(path, ros_field, how.columns), how)


def ros_rows(numbers: Numbers, how: Conventions) -> LogRows:
    """Poses by the fields of messages.

    A stamp in one number is in nanoseconds if it is whole, as ROS writes it, else in seconds.
    """
    cells = numbers.cells
    stamp = cells.get("stamp", cells.get("time"))
    if "seconds" in cells:
        t = cells["seconds"] + 1e-9 * cells.get("nanoseconds", np.zeros(len(numbers.ids)))
    elif stamp is not None:
        t = stamp * 1e-9 if (stamp == np.round(stamp)).all() else stamp
    else:
        raise InputError(f"{numbers.file}: the time is missing, such as header.stamp.sec; export the header too.")
    notes = ["lengths in m, as in ROS", "quaternions by the names of the fields, as in ROS"]
    return LogRows(numbers.ids, t, read_poses(numbers, how)[0], numbers.places, notes)


def read_tum(path: Path, how: Conventions) -> LogRows:
    """`timestamp tx ty tz qx qy qz qw` with spaces between, m; the name of the file is the id."""
    lines = enumerate(read_text(path, "log", LARGEST_LOG_BYTES).splitlines(), start=1)
    rows = {f"{path}, line {line}": text.split() for line, text in lines if text.strip() and text.lstrip()[0] != "#"}
    for place, words in rows.items():
        require(
            len(words) == 8,
            f"{place}: eight numbers with spaces between them are needed, timestamp tx ty tz qx qy qz qw; "
            f"'{one_line(' '.join(words), 40)}' was given.",
        )
    require(rows, f"{path}: no pose stands in the file; lines of timestamp tx ty tz qx qy qz qw are needed.")
    places = [*rows]
    cells = np.column_stack([finite_numbers(texts, places) for texts in zip(*rows.values(), strict=True)])
    check_length(cells[:, 4:], "a quaternion", places)
    notes = ["lengths in m, as in TUM", "quaternions x, y, z, w, as in TUM"]
    return LogRows([path.stem] * len(cells), cells[:, 0], pose.unpack(cells[:, [1, 2, 3, 7, 4, 5, 6]]), places, notes)


def _read_numbers(path: Path, meaning: Callable[[str], LogColumn | None], stated: Mapping[str, str]) -> Numbers:
    """The columns of a file that mean something.

    Args:
        stated: A name that means something -> column of the file.
    """
    lines = list(_split_lines(path))
    require(lines, f"{path}: the file is empty; its first line names the columns, such as t_s,id,x_mm,y_mm,z_mm.")
    (first, names), *rows = lines
    place = f"{path}, line {first}"
    columns = _columns(place, names, meaning, stated)
    for line, cells in rows:
        require(
            len(cells) == len(names),
            f"{path}, line {line}: {len(names)} cells are needed, as many as line {first} has, which is read as the "
            f"names of columns; {len(cells)} were given. Let the log begin with the line of names, and leave out "
            "broken rows.",
        )
    places = [f"{path}, line {line}" for line, _ in rows]
    texts = {each.meaning: [cells[i] for _, cells in rows] for i, each in columns.items()}
    ids = texts.pop("id", [path.stem] * len(rows))
    where = {each.meaning: f", column {one_line(names[i], 40)}" for i, each in columns.items()}
    return Numbers(
        file=str(path),
        cells={name: finite_numbers(given, places, where[name]) for name, given in texts.items()},
        units={each.meaning: each.unit for each in columns.values()},
        ids=ids,
        places=places,
    )


def _columns(
    place: str, names: Sequence[str], meaning: Callable[[str], LogColumn | None], stated: Mapping[str, str]
) -> Mapping[int, LogColumn]:
    """Which columns mean something, and what."""
    check_separator(place, names)
    there = {name.lower() for name in names}
    for ours, theirs in stated.items():
        require_known("column", theirs.strip().lower(), there, place=f"{place}: the camera file, log.columns, {ours}")
        require(
            meaning(ours) is not None,
            f"{place}: the camera file, log.columns: '{one_line(ours, 40)}' means nothing here; allowed are names of "
            "columns such as id, t_s, x_mm, qw.",
        )
    renamed = {theirs.strip().lower(): ours for ours, theirs in stated.items()}
    known = [meaning(renamed.get(name.lower(), name)) for name in names]
    columns = {i: each for i, each in enumerate(known) if each is not None}
    require(
        columns or all(np.isnan(_number(name)) for name in names),
        f"{place}: the names of columns are needed, such as t_s,id,x_mm, and numbers were given; let the log begin "
        "with a line of names.",
    )
    for name, count in Counter(each.meaning for each in columns.values()).items():
        require(count <= 1, f"{place}: two columns say '{name}'; keep one, or name the other one otherwise.")
    return columns


def ros_field(name: str) -> LogColumn | None:
    """What a column is, by the last names in it: `field.pose.position.x`, `/vision/pose/position/x`."""
    words = re.split(r"[./]", name.strip().lower().lstrip("%"))
    return _FIELDS.get(".".join(words[-2:])) or _FIELDS.get(words[-1])


def _split_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is not empty."""
    reader = csv.reader(io.StringIO(read_text(path, "log", LARGEST_LOG_BYTES), newline=""), skipinitialspace=True)
    try:
        for cells in reader:
            if any(cells):
                yield reader.line_num, [cell.strip() for cell in cells]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: this is not a CSV file ({error}).") from error


def finite_numbers(texts: Sequence[Any], places: Sequence[str], where: str = "") -> Array:
    """Finite numbers, (n,)."""
    x = np.array([_number(text) for text in texts])
    wrong = np.flatnonzero(~(np.abs(x) <= _LARGEST))
    if len(wrong):
        given = f"'{one_line(str(texts[wrong[0]]), 40)}' was given"
        raise InputError(f"{places[wrong[0]]}{where}: a finite number is needed, {given}; leave out such rows.")
    return x


def _number(text: Any) -> float:
    try:
        return float(text)
    except (ValueError, TypeError, OverflowError):
        return np.nan
