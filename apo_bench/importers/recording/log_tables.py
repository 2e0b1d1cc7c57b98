"""Read text files of poses as tables: find comments, separator, header and blank cells; one table for each object.

Tables with one header line, Motive and Vicon files with several, numbers without a header (TUM, KITTI, EuRoC, `ros2
topic echo --csv`), BOP results, and files that hold one matrix.
"""

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.importers.recording.log_columns import MATRIX, POSITION, ROTATIONS, SHARED, LogColumn, find_column
from apo_bench.importers.recording.motion_capture import find_rate, name_motive_columns, name_vicon_columns
from apo_bench.io import read_text

LARGEST_LOG_BYTES = 200_000_000
_SEPARATORS = (";", "\t", ",", "|", " ")  # a space stands for any white space
_HEADER_LINES = 200  # the header stands among these first lines
_MOST_BROKEN = 0.1  # largest share of rows with another number of cells
_MOST_NAMES = 12  # largest number of names that an error lists
_POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
_MATRIX_ROWS = tuple(name for i in (1, 2, 3) for name in (f"r{i}1", f"r{i}2", f"r{i}3", f"{'xyz'[i - 1]}"))
_UNNAMED: Mapping[int, tuple[str, Sequence[str]]] = {
    7: ("positions and quaternions xyzw, without a header", ("x", "y", "z", *_POSE[3:])),
    8: ("TUM", ("t", *_POSE)),
    12: ("KITTI, matrices row by row", _MATRIX_ROWS),
    13: ("times and matrices, row by row", ("t", *_MATRIX_ROWS)),
    16: ("matrices, row by row", (*_MATRIX_ROWS, "", "", "", "")),
    17: ("EuRoC", ("t", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", *[""] * 9)),
}
"""Number of columns without a header -> what they are, and their names."""
_BOP = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
_BOP_NAMES = ("scene", "frame", "id", "score", *MATRIX, "x_mm", "y_mm", "z_mm", "")


class LogTable(NamedTuple):
    """The poses of a log as written in the file, one row each."""

    file: Path
    form: str
    """What the file was recognised as."""
    name: str
    """The object, for rows without a column of ids."""
    columns: Mapping[str, LogColumn]
    """Meaning -> its column."""
    cells: Mapping[str, Sequence[Any]]
    """Meaning -> the cells of its column."""
    places: Sequence[str]
    """Location of each row for messages, as `file, line 3`."""
    rate_hz: float = 0.0
    """Rate of images that the file states, for files without times."""
    broken: int = 0
    """Number of rows that were left out, as they have another number of cells."""


class _Line(NamedTuple):
    number: int
    text: str
    is_comment: bool


_Columns = Sequence[LogColumn | None]
"""Meaning of each column; None: ignored."""


def read_text_tables(path: Path, columns: Mapping[str, str] | Sequence[str]) -> list[LogTable]:
    """Read a text file; one table, or one for each object where objects stand side by side.

    Args:
        columns: Names of columns as this package knows them -> names in the file; or the names of all columns in order.

    Raises:
        InputError: No header is found, or many rows have another number of cells.
    """
    stripped = ((i, text.strip()) for i, text in enumerate(read_text(path, "log", LARGEST_LOG_BYTES).splitlines(), 1))
    lines = [_Line(i, text, text.startswith(("#", "%", "//"))) for i, text in stripped if text.strip(",; \t")]
    require(lines, f"{path}: the file is empty; give a log with one row per pose.")
    separator = _find_separator([line.text for line in lines if not line.is_comment][-400:])
    for at, line in enumerate(lines[:_HEADER_LINES]):
        text = line.text.lstrip("#%/ ")
        cells = _split(text, separator)
        axes = [cell.lower() for cell in cells]
        if tuple(cells) == _BOP:  # the numbers of the matrix and of the position stand in one cell each
            texts = [each._replace(text=each.text.replace(" ", ",")) for each in lines[at + 1 :]]
            return _collect(path, "BOP results", _understand(_BOP_NAMES), texts, ",")
        if axes[0] == "frame" and (axes[1:2] == ["sub frame"] or axes.count("x") > 1):
            return _read_motion_capture(path, lines, at, separator)
        if isinstance(columns, Mapping):
            for names in (cells, *(_split(text, other) for other in _SEPARATORS)):
                known = _understand(names, columns)
                if _list_objects(known):
                    return _collect(path, "a table with a header", known, lines[at + 1 :], separator)
    return _read_unnamed(path, [line for line in lines if not line.is_comment], separator, columns)


def _find_separator(texts: Sequence[str]) -> str:
    """Return the separator that divides most lines into equally many cells, at least four."""
    for separator in _SEPARATORS:
        counts = Counter(len(_split(text, separator)) for text in texts)
        cells, lines = counts.most_common(1)[0] if counts else (0, 0)
        if cells >= 4 and lines >= 0.8 * len(texts):
            return separator
    return ","


def _split(text: str, separator: str) -> list[str]:
    """Return the cells of a line."""
    if separator == " ":
        return text.split()
    cells = [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]
    if separator != ",":  # a comma is a decimal point where another separator stands between cells
        cells = [re.sub(r"^(-?\d+),(\d+(?:[eE][+-]?\d+)?)$", r"\1.\2", cell) for cell in cells]
    return cells


def _understand(names: Sequence[str], renamed: Mapping[str, str] | Sequence[str] = ()) -> _Columns:
    """Return the meaning of each column of a header."""
    ours = {theirs.strip().lower(): mine for mine, theirs in renamed.items()} if isinstance(renamed, Mapping) else {}
    lower = [name.strip().lower() for name in names]
    from_zero = any(re.search(r"(m|r|rot)_?0_?0$", name) for name in lower)
    return [find_column(ours.get(name, name), from_zero) for name in lower]


def _list_objects(columns: _Columns) -> list[str]:
    """Return the objects of which a position and a rotation is there, in the order of their columns."""
    meanings: dict[str, set[str]] = {}
    for column in columns:
        if column is not None and column.meaning not in SHARED:
            meanings.setdefault(column.of, set()).add(column.meaning)
    return [of for of, known in meanings.items() if known >= {*POSITION} and any(known >= {*R} for R in ROTATIONS)]


def _collect(
    path: Path, form: str, columns: _Columns, lines: Sequence[_Line], separator: str, rate_hz: float = 0.0
) -> list[LogTable]:
    """Return the tables of the lines after a header, without comments and broken rows: one for each object."""
    rows, places = [], []
    broken: list[tuple[int, int]] = []
    for line in (line for line in lines if not line.is_comment):
        cells = _split(line.text, separator)
        cells += [""] * (separator != " " and len(cells) == len(columns) - 1)
        if len(cells) < len(columns) or any(cells[len(columns) :]):
            broken.append((line.number, len(cells)))
        else:
            rows.append(cells[: len(columns)])
            places.append(f"{path}, line {line.number}")
    if len(broken) > _MOST_BROKEN * (len(rows) + len(broken)):
        number, count = broken[0]
        raise InputError(
            f"{path}, line {number}: {count} cells stand here, and {len(columns)} are needed; leave out broken rows."
        )
    cells_of = list(zip(*rows, strict=True)) or [()] * len(columns)
    is_named = any(column is not None and column.meaning == "id" for column in columns)
    objects = _list_objects(columns)[: 1 if is_named else None]
    tables = []
    for of in objects:
        own = _find_own_columns(path, columns, of)
        named = {meaning: column for meaning, i in own.items() if (column := columns[i]) is not None}
        name = path.stem if len(objects) == 1 else of.replace(".", "/").strip("/")
        own_cells = {meaning: cells_of[i] for meaning, i in own.items()}
        tables.append(LogTable(path, form, name, named, own_cells, places, rate_hz, len(broken)))
    return tables


def _find_own_columns(path: Path, columns: _Columns, of: str) -> dict[str, int]:
    """Return meaning -> index of the columns of an object: its own, and of shared ones those with the nearest name."""
    own: dict[str, LogColumn] = {}
    for column in (column for column in columns if column is not None):
        before = own.get(column.meaning)
        if column.meaning in SHARED:
            is_own = f"{of}.".startswith(f"{column.of}." if column.of else "")
            if is_own and (before is None or len(column.of) > len(before.of)):
                own[column.meaning] = column
        elif column.of == of:
            require(before is None, f"{path}: two columns mean '{column.meaning}'; keep one, or rename the other.")
            own[column.meaning] = column
    return {meaning: next(i for i, each in enumerate(columns) if each is column) for meaning, column in own.items()}


def _read_unnamed(
    path: Path, lines: Sequence[_Line], separator: str, columns: Mapping[str, str] | Sequence[str]
) -> list[LogTable]:
    """Read rows without a header, from the number and kind of their cells or the stated names of all columns."""
    first = _split(lines[0].text, separator)
    is_number = [_is_number(cell) for cell in first]
    if not isinstance(columns, Mapping):
        rows = lines if any(is_number) else lines[1:]  # without a header that the stated names replace
        return _collect(path, "columns as stated", _understand(columns), rows, separator)
    texts = [i for i, cell in enumerate(first[:12]) if cell and not is_number[i]]
    if texts in ([2], [2, 3]) and len(first) >= 10 and first[0].isdigit() and first[1].isdigit():
        # sec, nanosec, frame_id, perhaps child_frame_id, then the pose; a covariance may follow.
        is_named = len(texts) == 2 or len(first) == 4 + len(_POSE)  # a child_frame_id may be a number
        names = ["sec", "nanosec", "", *["id"] * is_named, *_POSE]
        names += [""] * (len(first) - len(names))
        return _collect(path, "ros2 topic echo --csv", _understand(names), lines, separator)
    if all(is_number) and len(first) == 4 and len(lines) in (3, 4):
        joined = " ".join(" ".join(_split(line.text, separator)) for line in lines[:3])
        return _collect(path, "a matrix in each file", _understand(_MATRIX_ROWS), [_Line(1, joined, False)], " ")
    if all(is_number) and len(first) in _UNNAMED:
        form, known = _UNNAMED[len(first)]
        return _collect(path, form, _understand(known), lines, separator)
    raise _explain_header(path, lines, separator, columns)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _explain_header(path: Path, lines: Sequence[_Line], separator: str, renamed: Mapping[str, str]) -> InputError:
    """Return an error that names the columns that were understood, and those that are missing."""
    headers = [(line.number, _split(line.text, separator)) for line in lines[:_HEADER_LINES]]
    number, names = max(headers, key=lambda each: sum(column is not None for column in _understand(each[1])))
    place = f"{path}: the camera file, log.columns"
    for mine, theirs in renamed.items():
        require_known("column", theirs.strip().lower(), [name.strip().lower() for name in names], place=place)
        require(find_column(mine), f"{place}: '{one_line(mine, 40)}' has no meaning; use names such as id, t_s, x_mm.")
    columns = _understand(names, renamed)
    known = [name for name, column in zip(names, columns, strict=True) if column is not None]
    ignored = [name for name, column in zip(names, columns, strict=True) if column is None]
    meanings = {column.meaning for column in columns if column is not None}
    missing = "a position" if not meanings >= {*POSITION} else "one rotation"
    return InputError(
        f"{path}, line {number}: {missing} is missing; understood: {_listed(known)}; not understood: "
        f"{_listed(ignored)}; name columns such as x_mm y_mm z_mm and qw qx qy qz, or state `columns` in the camera "
        "file."
    )


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return (", ".join(one_line(name, 40) for name in names[:_MOST_NAMES]) or "nothing") + more


def _read_motion_capture(path: Path, lines: Sequence[_Line], at: int, separator: str) -> list[LogTable]:
    """Read a file of Motive or Vicon.

    Args:
        at: Index of the line with the axes, which begins with `Frame`.
    """
    axes = [cell.lower() for cell in _split(lines[at].text, separator)]
    cells = [_split(line.text, separator) for line in lines[: at + 2]]
    padded = [[*row, *[""] * (len(axes) - len(row))][: len(axes)] for row in cells]
    is_vicon = axes[1] == "sub frame"
    form = "Vicon CSV" if is_vicon else "Motive CSV"
    names = name_vicon_columns(padded[at - 1], axes, padded[-1]) if is_vicon else name_motive_columns(padded[:at], axes)
    columns = _understand(names)
    require(
        _list_objects(columns), f"{path}: the {form} has no rigid body with a position and a rotation; export both."
    )
    rows = [line for line in lines[at + 1 :] if _is_number(line.text.split(separator)[0])]
    return _collect(path, form, columns, rows, separator, find_rate(cells[:at]))
