"""Pose estimates in the results format of the BOP benchmark.

The first line is `scene_id,im_id,obj_id,score,R,t,time`; R is nine numbers row by row and t three, with spaces between.
"""

from array import array
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import open_file

_COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
_NUMBERS = 14
"""Score, R, t and time."""
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
        place = self.place[row]
        return f"{self.file}, {place if isinstance(place, str) else f'line {place}'}"


def read_results(path: str | Path) -> PoseRows:
    """The rows of a results file; times are checked and not kept.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    numbers = array("d")
    with open_file(path, "CSV file") as stream:
        for line, raw in enumerate(stream, start=1):
            text = raw.decode("utf-8-sig", "replace").strip()
            place = f"{path}, line {line}"
            if line == 1:
                head = tuple(cell.strip() for cell in text.split(","))
                require(head == _COLUMNS, f"{place}: the columns are {text[:80]}; needed are {','.join(_COLUMNS)}.")
            elif text:
                numbers.extend((line, *_row(text, place)))
    require(numbers, f"{path}: no pose stands in the file; give a first line {','.join(_COLUMNS)}, and rows below it.")
    # Line, scene, image, object, score, R row by row, t, time: whole numbers of so many digits are exact.
    cells = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 4 + _NUMBERS)
    whole = cells[:, :4].astype(np.int64)
    R = cells[:, 5:14].reshape(-1, 3, 3)
    return check_rows(PoseRows(str(path), whole[:, 1:], R, cells[:, 14:17], whole[:, 0], cells[:, 4]))


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
    cells = np.concatenate([rows.where, rows.t_mm, rows.R.reshape(-1, 9)], axis=1)
    again = np.setdiff1d(np.arange(len(cells)), np.unique(cells, axis=0, return_index=True)[1])
    if again.size:
        raise InputError(f"{rows.spot(int(again[0]))}: an earlier row stands there once more; keep one of the two.")
    return rows


def _row(text: str, place: str) -> list[float]:
    """Scene, image, object, score, the twelve numbers of R and t, and the time."""
    cells = text.split(",")
    require(len(cells) == len(_COLUMNS), f"{place}: {len(_COLUMNS)} cells are needed, {len(cells)} were given.")
    try:
        ids = [int(cell) for cell in cells[:3]]
        counts = [len(cell.split()) for cell in cells[3:]]
        numbers = [float(word) for cell in cells[3:] for word in cell.split()]
    except ValueError as error:
        raise InputError(f"{place}: {error}; only numbers are allowed.") from error
    require(counts == [1, 9, 3, 1], f"{place}: score, R, t and time are 1, 9, 3 and 1 numbers, {counts} were given.")
    within = min(ids) >= 0 and max(ids) <= LARGEST_ID and all(abs(x) <= LARGEST_MM for x in numbers)
    require(within, f"{place}: scene, image and object from 0 and other numbers of at most {LARGEST_MM:g} are needed.")
    return [*ids, *numbers]
