"""Logs as comma-separated values: one row per pose, columns known by their names; or as exported from ROS bags."""

import csv
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError, one_line
from apo_bench.geometry import Array
from apo_bench.io.ordinary_files import opened
from apo_bench.io.strict_csv import check_separator
from apo_bench.recording.camera_file import Conventions
from apo_bench.recording.columns import LogColumn, check_renamed, column, poses, row_times
from apo_bench.recording.log import LARGEST_LOG_BYTES, MOST_POSES, LogRows

_LONGEST_LINE = 16384
_LARGEST = 1e20


class Numbers(NamedTuple):
    """A table as it stands in a file, with the unit in the name of each column."""

    cells: Mapping[str, Array]
    units: Mapping[str, str]
    ids: Sequence[str]
    lines: Sequence[int]


def read_csv_log(path: Path, how: Conventions) -> tuple[LogRows, list[str]]:
    """The rows of a file whose columns name what they are; without a column of ids, its name is the id of all."""
    table = read_numbers(path, column, how.columns)
    places = [f"{path}, line {line}" for line in table.lines]
    T, notes = poses(table.cells, table.units, how, str(path), places)
    return LogRows(table.ids, row_times(table.cells, table.units, how, str(path)), T, places), notes


def read_numbers(path: Path, meaning: Callable[[str], LogColumn | None], renamed: Mapping[str, str]) -> Numbers:
    """The columns of a file that mean something.

    Args:
        renamed: Column of the file -> a name that means something.
    """
    lines = text_lines(path)
    first, names = next(lines, (0, []))
    if not names:
        raise InputError(f"{path}: the file is empty; its first line names the columns, such as t_s,id,x_mm,y_mm,z_mm.")
    place = f"{path}, line {first}"
    check_separator(place, names)
    check_renamed(names, renamed, lambda name: meaning(name) is not None, str(path))
    known = [meaning(renamed.get(name.strip().lower(), name)) for name in names]
    columns = {i: each for i, each in enumerate(known) if each is not None}
    for name, count in Counter(each.meaning for each in columns.values()).items():
        if count > 1:
            raise InputError(f"{place}: two columns say '{name}'; keep one, or name the other one otherwise.")
    of_id = next((i for i, each in columns.items() if each.meaning == "id"), None)
    cells = {i: array("d") for i in columns if i != of_id}
    ids = list[str]()
    at = array("q")
    for line, texts in lines:
        if len(texts) != len(names):
            raise InputError(f"{path}, line {line}: {len(names)} cells are needed, {len(texts)} were given.")
        if len(at) == MOST_POSES:
            raise InputError(f"{path}, line {line}: a log of at most {MOST_POSES:,} rows is needed; cut it.")
        for i, column_cells in cells.items():
            column_cells.append(finite_number(texts[i], f"{path}, line {line}, column {one_line(names[i], 40)}"))
        ids.append(path.stem if of_id is None else texts[of_id])
        at.append(line)
    return Numbers(
        {columns[i].meaning: np.array(column_cells) for i, column_cells in cells.items()},
        {each.meaning: each.unit for each in columns.values()},
        ids,
        at,
    )


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
    line = 0
    with opened(path, "log") as stream:
        for line, raw in enumerate(iter(lambda: stream.readline(_LONGEST_LINE + 1), b""), start=1):
            size += len(raw)
            if len(raw) > _LONGEST_LINE:
                raise InputError(f"{path}, line {line}: a line of at most {_LONGEST_LINE} characters is needed.")
            if size > LARGEST_LOG_BYTES:
                raise InputError(f"{path}: the file is larger than {LARGEST_LOG_BYTES / 1e6:g} MB; cut the log.")
            try:
                text = raw.decode("utf-8-sig" if line == 1 else "utf-8")
            except UnicodeDecodeError as error:
                raise InputError(f"{path}, line {line}: this is not UTF-8 text; give a log as text.") from error
            if text.strip():
                yield line, text.split() if separator is None else _cells(text)


def _cells(text: str) -> list[str]:
    if '"' not in text:
        return [cell.strip() for cell in text.split(",")]
    return [cell.strip() for cell in next(csv.reader([text]))]


def rows_of_files(
    path: Path, endings: Iterable[str], read: Callable[[Path], tuple[LogRows, list[str]]]
) -> tuple[LogRows, list[str]]:
    """The rows of a file, or of all files of a folder, one an object."""
    if not path.is_dir():
        return read(path)
    files = sorted(file for ending in endings for file in path.glob(f"*{ending}"))
    if not files:
        raise InputError(
            f"{path}: the folder holds no file that ends in {' or '.join(endings)}; give a folder of logs."
        )
    parts = [read(file) for file in files]
    ids, t, T, places = zip(*(rows for rows, _ in parts), strict=True)
    return LogRows([*chain(*ids)], np.concatenate(t), np.concatenate(T), [*chain(*places)]), parts[0][1]
