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
from apo_bench.importers.recording.log_columns import (
    EULER_ANGLES,
    MATRIX,
    POSITION,
    QUATERNION,
    ROTATION_VECTOR,
    ROTATIONS,
    SHARED,
    LogColumn,
    find_column,
)
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
_BOP_NAMES = ("scene", "frame", "id", "score", *MATRIX, "x_mm", "y_mm", "z_mm")
_KINDS_OF_BODIES = ("rigid body", "bone", "rigid body marker", "marker")  # the second header line of Motive


class LogTable(NamedTuple):
    """The cells of a log as written in the file, one row per pose."""

    file: Path
    form: str
    """What the file was recognised as."""
    name: str
    """The object, for rows without a column of ids."""
    columns: Sequence[LogColumn | None]
    """Meaning of each column; None: ignored."""
    rows: Sequence[Sequence[Any]]
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
        cells = _split(line.text.lstrip("#%/ "), separator)
        if tuple(cells) == _BOP:
            return [_read_bop(path, lines[at + 1 :])]
        axes = [cell.lower() for cell in cells]
        if axes[0] == "frame" and (axes[1:2] == ["sub frame"] or axes.count("x") > 1):
            heads = [_split(each.text, separator) for each in lines[:at]]
            return _read_motion_capture(path, heads, cells, lines[at + 1 :], separator)
        if not isinstance(columns, Sequence):
            for names in (cells, *(_split(line.text.lstrip("#%/ "), other) for other in _SEPARATORS)):
                found = _understand(path, names, columns)
                if _complete_objects(found):
                    table = _collect(path, "a table with a header", found, lines[at + 1 :], separator)
                    return _split_objects(table._replace(name=path.stem))
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


def _understand(
    path: Path, names: Sequence[str], renamed: Mapping[str, str], check: bool = False
) -> list[LogColumn | None]:
    """Return the meaning of each column of a header, None where it is ignored."""
    ours = {theirs.strip().lower(): mine for mine, theirs in renamed.items()}
    if check:
        for theirs, mine in ours.items():
            place = f"{path}: the camera file, log.columns"
            require_known("column", theirs, [name.lower() for name in names], place=place)
            require(
                find_column(mine), f"{place}: '{one_line(mine, 40)}' has no meaning; use names such as id, t_s, x_mm."
            )
    lower = [name.strip().lower() for name in names]
    from_zero = any(re.search(r"(m|r|rot)_?0_?0$", name) for name in lower)
    return [find_column(ours.get(name, name), from_zero) for name in lower]


def _complete_objects(columns: Sequence[LogColumn | None]) -> list[str]:
    """Return the objects of which a position and a rotation is there, in the order of their columns."""
    meanings: dict[str, set[str]] = {}
    for column in columns:
        if column is not None and column.meaning not in SHARED:
            meanings.setdefault(column.of, set()).add(column.meaning)
    return [of for of, known in meanings.items() if known >= {*POSITION} and any(known >= {*R} for R in ROTATIONS)]


def _collect(
    path: Path, form: str, columns: Sequence[LogColumn | None], lines: Sequence[_Line], separator: str
) -> LogTable:
    """Return the table of the lines after a header, without comments, repeated headers and broken rows."""
    rows, places = [], []
    broken: list[tuple[int, int]] = []
    for line in lines:
        if line.is_comment:
            continue
        cells = _split(line.text, separator)
        cells += [""] * (len(columns) - len(cells) if separator != " " and len(cells) == len(columns) - 1 else 0)
        if len(cells) == len(columns) or (not any(cells[len(columns) :]) and len(cells) > len(columns)):
            rows.append(cells[: len(columns)])
            places.append(f"{path}, line {line.number}")
        else:
            broken.append((line.number, len(cells)))
    if len(broken) > _MOST_BROKEN * (len(rows) + len(broken)):
        number, count = broken[0]
        raise InputError(
            f"{path}, line {number}: {count} cells stand here, and {len(columns)} are needed; leave out broken rows."
        )
    return LogTable(path, form, path.stem, columns, rows, places, broken=len(broken))


def _split_objects(table: LogTable) -> list[LogTable]:
    """Return one table for each object whose columns stand side by side."""
    objects = _complete_objects(table.columns)
    named = any(column is not None and column.meaning == "id" for column in table.columns)
    objects = objects[:1] if named else objects
    tables = []
    for of in objects:
        kept: list[LogColumn | None] = []
        nearest: dict[str, LogColumn] = {}
        for column in table.columns:
            if (
                column is not None
                and column.meaning in SHARED
                and f"{of}.".startswith(f"{column.of}." if column.of else "")
            ):
                known = nearest.get(column.meaning)
                nearest[column.meaning] = column if known is None or len(column.of) > len(known.of) else known
        for column in table.columns:
            mine = column is not None and (column.of == of and column.meaning not in SHARED)
            shared = column is not None and nearest.get(column.meaning) is column
            kept.append(column if mine or shared else None)
        name = table.name if len(objects) == 1 else of.replace(".", "/").strip("/")
        tables.append(table._replace(name=name, columns=kept))
    return tables


def _read_bop(path: Path, lines: Sequence[_Line]) -> LogTable:
    """Read BOP results: nine numbers of the matrix and three of the position stand in one cell each."""
    columns = _understand(path, _BOP_NAMES, {})
    texts = [line._replace(text=line.text.replace(" ", ",")) for line in lines]
    return _collect(path, "BOP results", [*columns, None], texts, ",")


def _read_unnamed(
    path: Path, lines: Sequence[_Line], separator: str, columns: Mapping[str, str] | Sequence[str]
) -> list[LogTable]:
    """Read rows without a header, from the number and kind of their cells or the stated names of all columns."""
    first = _split(lines[0].text, separator)
    if isinstance(columns, Sequence):
        if not any(map(_is_number, first)):  # a header that the stated names replace
            lines = lines[1:]
        return _split_objects(_collect(path, "columns as stated", _understand(path, columns, {}), lines, separator))
    texts = [i for i, cell in enumerate(first[:12]) if cell and not _is_number(cell)]
    if texts in ([2], [2, 3]) and len(first) >= 10 and first[0].isdigit() and first[1].isdigit():
        # sec, nanosec, frame_id, perhaps child_frame_id, then the pose; a covariance may follow.
        is_named = len(texts) == 2 or len(first) == 4 + len(_POSE)  # a child_frame_id may be a number
        names = ["sec", "nanosec", "", *["id"] * is_named, *_POSE]
        known = [*_understand(path, names, {}), *[None] * (len(first) - len(names))]
        return [_collect(path, "ros2 topic echo --csv", known, lines, separator)]
    if all(map(_is_number, first)):
        if len(first) == 4 and len(lines) in (3, 4):
            cells = [cell for line in lines[:3] for cell in _split(line.text, separator)]
            columns_known = _understand(path, _MATRIX_ROWS, {})
            return [LogTable(path, "a matrix in each file", path.stem, columns_known, [cells], [str(path)])]
        if len(first) in _UNNAMED:
            form, names_known = _UNNAMED[len(first)]
            return [_collect(path, form, _understand(path, names_known, {}), lines, separator)]
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
    number, names = max(headers, key=lambda each: sum(column is not None for column in _understand(path, each[1], {})))
    known = _understand(path, names, renamed, check=True)
    understood = [name for name, column in zip(names, known, strict=True) if column is not None]
    ignored = [name for name, column in zip(names, known, strict=True) if column is None]
    meanings = {column.meaning for column in known if column is not None}
    missing = "a position" if not meanings >= {*POSITION} else "one rotation"
    return InputError(
        f"{path}, line {number}: {missing} is missing; understood: {_listed(understood)}; not understood: "
        f"{_listed(ignored)}; name columns such as x_mm y_mm z_mm and qw qx qy qz, or state `columns` in the camera "
        "file."
    )


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return (", ".join(one_line(name, 40) for name in names[:_MOST_NAMES]) or "nothing") + more


def _read_motion_capture(
    path: Path, heads: Sequence[Sequence[str]], axes: Sequence[str], lines: Sequence[_Line], separator: str
) -> list[LogTable]:
    """Read a file of Motive or Vicon: names, kinds and axes of the columns stand in separate lines.

    Args:
        heads: The lines before that with the axes.
        axes: The line that begins with `Frame`.
    """
    is_vicon = axes[1].lower().replace(" ", "") == "subframe"
    units = _split(lines[0].text, separator) if is_vicon else []
    stated = " ".join(cell for head in heads for cell in head).lower()
    unit = next(
        (short for long, short in (("millimeters", "mm"), ("centimeters", "cm"), ("meters", "m")) if long in stated), ""
    )
    rates = re.search(r"(?:export|capture) frame rate\s+([\d.]+)", stated)
    rate = (
        float(rates[1])
        if rates
        else next((float(h[0]) for h in heads if len([c for c in h if c]) == 1 and _is_number(h[0])), 0.0)
    )
    kinds = [""] * len(axes)  # rotation or position
    names = [""] * len(axes)
    bodies = [True] * len(axes)
    for at, head in enumerate(heads):
        cells = [*head, *[""] * (len(axes) - len(head))][: len(axes)]
        lower = [cell.lower() for cell in cells]
        if is_vicon and at == len(heads) - 1:
            for i in range(len(axes)):
                names[i] = cells[i].split()[-1].split(":")[0] if cells[i] else (names[i - 1] if i else "")
        elif not is_vicon and {*lower[2:]} & {*_KINDS_OF_BODIES}:
            bodies = [cell == "rigid body" for cell in lower]
            names = [*heads[at + 1], *[""] * len(axes)][: len(axes)]
        elif not is_vicon and {"rotation", "position"} <= {*lower}:
            kinds = lower
    columns: list[LogColumn | None] = []
    for i, axis in enumerate(map(str.lower, axes)):
        if i == 0:
            columns.append(LogColumn("frame"))
        elif axis.startswith("time"):
            columns.append(LogColumn("t", "s"))
        elif not names[i] or not bodies[i]:
            columns.append(None)
        elif is_vicon:
            known = units[i].lower() if i < len(units) else ""
            meaning = axis.lstrip("t") if axis[0] == "t" else {"rw": "qw"}.get(axis, axis)
            columns.append(LogColumn(meaning, known if known in ("mm", "cm", "m", "deg", "rad") else "", names[i]))
        elif kinds[i] == "rotation":
            columns.append(LogColumn(f"q{axis}", "", names[i]))
        else:
            columns.append(LogColumn(axis, unit, names[i]) if kinds[i] == "position" else None)
    columns = [_complete_rotation(column, columns) for column in columns]
    rows = [line for line in lines[int(is_vicon) :] if _is_number(line.text.split(separator)[0])]
    form = "Vicon CSV" if is_vicon else "Motive CSV"
    require(
        _complete_objects(columns), f"{path}: the {form} has no rigid body with a position and a rotation; export both."
    )
    return _split_objects(_collect(path, form, columns, rows, separator)._replace(rate_hz=rate))


def _complete_rotation(column: LogColumn | None, columns: Sequence[LogColumn | None]) -> LogColumn | None:
    """Return a column with the meaning of its rotation: a quaternion (with w), Euler angles or a rotation vector."""
    if column is None or column.meaning not in (*QUATERNION, *ROTATION_VECTOR):
        return column
    own = {each.meaning for each in columns if each is not None and each.of == column.of}
    if "qw" in own:
        return column._replace(meaning=f"q{column.meaning[1]}", unit="")
    if column.meaning in QUATERNION:
        return LogColumn(EULER_ANGLES["xyz".index(column.meaning[1])], "deg", column.of)
    return column
