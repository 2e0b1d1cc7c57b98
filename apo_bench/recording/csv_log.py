"""Logs as comma-separated values: one row per pose, columns known by their names; or as exported from ROS bags."""

import csv
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError, one_line
from apo_bench.geometry.arrays import Array
from apo_bench.io.reading import opened
from apo_bench.io.strict_csv import check_separator
from apo_bench.recording.camera_file import Conventions
from apo_bench.recording.columns import Column, check_renamed, column, poses, times
from apo_bench.recording.log import LARGEST_BYTES, MOST_ROWS, Rows

_LONGEST_LINE = 16384
_LARGEST = 1e20


class Numbers(NamedTuple):
    """A table as it stands in a file, with the unit in the name of each column."""

    cells: Mapping[str, Array]
    units: Mapping[str, str]
    ids: Sequence[str]
    lines: Sequence[int]


def read_csv_log(path: Path, how: Conventions) -> tuple[Rows, list[str]]:
    """The rows of a file whose columns name what they are; without a column of ids, its name is the id of all."""
    table = read_numbers(path, column, how.columns)
    places = [f"{path}, line {line}" for line in table.lines]
    T, notes = poses(table.cells, table.units, how, str(path), places)
    return Rows(table.ids, times(table.cells, table.units, how, str(path)), T, places), notes


def read_numbers(path: Path, meaning: Callable[[str], Column | None], renamed: Mapping[str, str]) -> Numbers:
    """The columns of a file that mean something.

    Args:
        renamed: Column of the file -> a name that means something.
    """
    lines = text_lines(path)
    line, names = next(lines, (0, []))
    if not names:
        raise InputError(f"{path}: the file is empty; its first line names the columns, such as t_s,id,x_mm,y_mm,z_mm.")
    check_separator(f"{path}, line {line}", names)
    check_renamed(names, renamed, lambda name: meaning(name) is not None, str(path))
    found = [meaning(renamed.get(name.strip().lower(), name)) for name in names]
    used = [(i, one) for i, one in enumerate(found) if one is not None]
    meanings = [one.meaning for _, one in used]
    for name in meanings:
        if meanings.count(name) > 1:
            raise InputError(
                f"{path}, line {line}: two columns say '{name}'; keep one, or name the other one otherwise."
            )
    numeric = [(i, one) for i, one in used if one.meaning != "id"]
    of_id = next((i for i, one in used if one.meaning == "id"), None)
    cells = [array("d") for _ in numeric]
    ids = list[str]()
    at = array("q")
    for line, texts in lines:
        if len(texts) != len(names):
            raise InputError(f"{path}, line {line}: {len(names)} cells are needed, {len(texts)} were given.")
        if len(at) == MOST_ROWS:
            raise InputError(f"{path}, line {line}: a log of at most {MOST_ROWS:,} rows is needed; cut it.")
        for (i, _), into in zip(numeric, cells, strict=True):
            into.append(number(texts[i], f"{path}, line {line}, column {one_line(names[i], 40)}"))
        ids.append(path.stem if of_id is None else texts[of_id])
        at.append(line)
    return Numbers(
        {
            one.meaning: np.frombuffer(x, dtype=np.float64) if len(x) else np.zeros(0)
            for (_, one), x in zip(numeric, cells, strict=True)
        },
        {one.meaning: one.unit for _, one in used},
        ids,
        at,
    )


def number(text: str, place: str) -> float:
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
            if size > LARGEST_BYTES:
                raise InputError(f"{path}: the file is larger than {LARGEST_BYTES / 1e6:g} MB; cut the log.")
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


def several(
    path: Path, endings: Iterable[str], read: Callable[[Path], tuple[Rows, list[str]]]
) -> tuple[Rows, list[str]]:
    """The rows of a file, or of all files of a folder, one an object."""
    if not path.is_dir():
        return read(path)
    files = sorted(file for ending in endings for file in path.glob(f"*{ending}"))
    if not files:
        raise InputError(
            f"{path}: the folder holds no file that ends in {' or '.join(endings)}; give a folder of logs."
        )
    parts = [read(file) for file in files]
    rows = [part for part, _ in parts]
    return Rows(
        [name for one in rows for name in one.ids],
        np.concatenate([one.t for one in rows]),
        np.concatenate([one.T for one in rows]),
        [place for one in rows for place in one.places],
    ), parts[0][1]
