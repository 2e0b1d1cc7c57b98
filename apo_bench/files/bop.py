"""Pose estimates in the results format of the BOP benchmark, read line by line: mm, model to camera.

The first line is `scene_id,im_id,obj_id,score,R,t,time`; R is nine numbers row by row and t three, with spaces between.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import check_separator, opened

_COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
_WANTED = "needed are, in this order, " + ",".join(_COLUMNS)
_LONGEST_LINE = 4096
MOST_ROWS = 1_000_000
LARGEST_ID = 2**31 - 1
LARGEST_MM = 1e6
_NOT_A_ROTATION = 0.02
"""R R^t may be so far from the identity: published truth is rounded, that of LM-O by 0.0096."""
_METRES = 20.0
"""Parts whose median distance to the camera is less than this, in mm, were surely given in metres."""


@final
@dataclass(frozen=True, eq=False)
class PoseRows:
    """Parts in images, one row for each."""

    file: str
    where: NDArray[np.int64]
    """(n, 3): scene, image, object."""
    R: Array
    """(n, 3, 3), camera from model, as written: nearly rotations."""
    t_mm: Array
    """(n, 3), camera from model, axes of OpenCV."""
    place: NDArray[Any]
    """Where each row stands in the file: the line, or the entry of a JSON document."""
    score: Array
    """(n,), of the estimator; NaN where the file has none."""

    def spot(self, row: int) -> str:
        """Where a row stands, for messages."""
        return f"{self.file}, {self.where_in_file(row)}"

    def where_in_file(self, row: int) -> str:
        """The line, or the entry of a JSON document."""
        place = self.place[row]
        return str(place) if isinstance(place, str) else f"line {place}"


def read_results(path: str | Path) -> PoseRows:
    """The rows of a results file; times are checked and not kept.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    numbers = array("d")
    for row, (line, text) in enumerate(_lines(path)):
        place = f"{path}, line {line}"
        require(row != MOST_ROWS, f"{place}: a file of at most {MOST_ROWS} rows is needed; split it by scenes.")
        numbers.extend((line, *_row(text, place)))
    require(numbers, f"{path}: no pose stands in the file; below its first line, one row per pose is needed.")
    # Line, scene, image, object, score, R row by row, t: whole numbers of so many digits are exact.
    cells = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 17)
    whole = cells[:, :4].astype(np.int64)
    R = cells[:, 5:14].reshape(-1, 3, 3)
    return check_rows(PoseRows(str(path), whole[:, 1:], R, cells[:, 14:], whole[:, 0], cells[:, 4]))


def check_rows(rows: PoseRows) -> PoseRows:
    """The rows, once every pose in them makes sense.

    Raises:
        InputError: One is no rotation, the unit is not mm, or a row stands twice.
    """
    square = np.abs(rows.R @ np.swapaxes(rows.R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = (square > _NOT_A_ROTATION) | (np.linalg.det(rows.R) < 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        fault = f"R R^t differs from the identity by {square[k]:.3g}" if square[k] > _NOT_A_ROTATION else "it mirrors"
        raise InputError(f"{rows.spot(k)}, R: a rotation matrix, row by row, is needed; {fault}.")
    distance = np.linalg.norm(rows.t_mm, axis=1)
    require(
        np.median(distance) >= _METRES,
        f"{rows.spot(0)}, t: millimetres are needed, and the median distance to the camera is "
        f"{np.median(distance):.3g}; if these are metres, multiply by 1000.",
    )
    _refuse_twice(rows)
    return rows


def _refuse_twice(rows: PoseRows) -> None:
    """Refuse the first row that is an earlier one once more, number by number."""
    cells = np.concatenate([rows.where.astype(np.float64), rows.t_mm, rows.R.reshape(-1, 9)], axis=1)
    order = np.lexsort(cells.T[::-1])
    same = np.flatnonzero((cells[order[1:]] == cells[order[:-1]]).all(axis=1))
    if same.size:
        i = same[np.argmin(order[same + 1])]
        first = int(order[i])
        again = int(order[i + 1])
        raise InputError(
            f"{rows.spot(again)}: the row of {rows.where_in_file(first)} stands there once more; keep one of the two."
        )


def _lines(path: str | Path) -> Iterator[tuple[int, str]]:
    """Number and text of every line below the first that is not empty."""
    line = 0
    try:
        with opened(path, "CSV file") as stream:
            for line, raw in enumerate(iter(lambda: stream.readline(_LONGEST_LINE + 1), b""), start=1):
                require(
                    len(raw) <= _LONGEST_LINE,
                    f"{path}, line {line}: a line of at most {_LONGEST_LINE} characters is needed.",
                )
                text = raw.decode("utf-8-sig" if line == 1 else "utf-8").strip()
                if line == 1:
                    _check_header(text, f"{path}, line 1")
                elif text:
                    yield line, text
    except UnicodeDecodeError as error:
        raise InputError(f"{path}, line {line}: this is not UTF-8 text; give a CSV file.") from error
    require(line, f"{path}: the file is empty; {_WANTED} in its first line.")


def _check_header(text: str, place: str) -> None:
    columns = tuple(cell.strip() for cell in text.split(","))
    if columns == _COLUMNS:
        return
    check_separator(place, columns)
    for column in _COLUMNS:
        require(column in columns, f"{place}: the column '{column}' is missing; {_WANTED}.")
    raise InputError(f"{place}: the columns are {text[:80]}; {_WANTED}.")


def _row(text: str, place: str) -> tuple[float, ...]:
    """Scene, image, object, score and the twelve numbers of R and t."""
    cells = text.split(",")
    require(
        len(cells) == len(_COLUMNS),
        f"{place}: {len(_COLUMNS)} cells are needed, one for each column, {len(cells)} were given.",
    )
    scene, image, part = (_id(cell.strip(), place, name) for cell, name in zip(cells, _COLUMNS[:3], strict=False))
    (score,) = _numbers(cells[3], 1, f"{place}, score")
    pose = _numbers(cells[4], 9, f"{place}, R") + _numbers(cells[5], 3, f"{place}, t")
    _numbers(cells[6], 1, f"{place}, time")
    return scene, image, part, score, *pose


def _id(text: str, place: str, name: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 10 and int(text) <= LARGEST_ID):
        raise InputError(f"{place}, {name}: a whole number from 0 is needed, '{text[:40]}' was given.")
    return int(text)


def _numbers(text: str, count: int, place: str) -> list[float]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) == count and all(-LARGEST_MM <= x <= LARGEST_MM for x in values) and "_" not in text:
        return values
    what = "a number" if count == 1 else f"{count} numbers with spaces between them"
    stands = (
        f"{len(values)} numbers were given" if len(values) not in (0, count) else f"'{text.strip()[:40]}' was given"
    )
    raise InputError(f"{place}: {what} of at most {LARGEST_MM:g} is needed, {stands}.")
