"""Read and write pose estimates in the results format of the BOP benchmark.

The first line is `scene_id,im_id,obj_id,score,R,t,time`. R is nine numbers row by row, t is three, separated by spaces.
"""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.io import open_file, write_file

_COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")  # the first line of a results file
_NUMBERS = 14
"""Numbers of score (1), R (9), t (3) and time (1)."""
LARGEST_ID = 2**31 - 1  # of a scene, an image or an object
LARGEST_MM = 1e6  # of any number but the ids
_NOT_A_ROTATION = 0.02
"""Largest element of R R^t - I: published truth is rounded, that of LM-O by 0.0096."""
_METRES = 20.0
"""If the median distance to the camera in mm is below this, the file is in metres."""


@final
@dataclass(frozen=True, eq=False)
class PoseRows:
    """Poses of objects in images, one row each."""

    file: str
    where: NDArray[np.int64]
    """(n, 3), integers: scene, image, object."""
    R: Array
    """(n, 3, 3), camera from model, as written: rotations up to rounding."""
    t_mm: Array
    """(n, 3), camera from model, OpenCV axes, [mm]."""
    place: NDArray[Any]
    """(n,), location of each row in the file: the line number, or the entry of a JSON document."""
    score: Array
    """(n,), score of the estimator; NaN where the file has none."""

    def location(self, row: int) -> str:
        """Return the location of a row, for messages."""
        place = self.place[row]
        return f"{self.file}, {place if isinstance(place, str) else f'line {place}'}"


def read_results(path: str | Path) -> PoseRows:
    """Read the rows of a results file; times are checked and dropped.

    Raises:
        InputError: The file deviates from the format; the message names the line.
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
                numbers.extend((line, *_read_row(text, place)))
    require(numbers, f"{path}: no pose stands in the file; give a first line {','.join(_COLUMNS)}, and rows below it.")
    # Columns: line, scene, image, object, score, R row by row, t, time. Integers of this size are exact in float64.
    cells = np.frombuffer(numbers, dtype=np.float64).reshape(-1, 4 + _NUMBERS)
    whole = cells[:, :4].astype(np.int64)
    R = cells[:, 5:14].reshape(-1, 3, 3)
    return check_rows(PoseRows(str(path), whole[:, 1:], R, cells[:, 14:17], whole[:, 0], cells[:, 4]))


class EstimatedPose(NamedTuple):
    """One row of a results file."""

    where: tuple[int, int, int]
    """Scene, image, object."""
    score: float
    T: Array
    """(4, 4), camera from model, OpenCV axes, [m]."""
    time_s: float
    """Time for all estimates of the image; -1 if it was not measured."""


def write_results(path: str | Path, estimates: Iterable[EstimatedPose]) -> None:
    """Write a results file; numbers are exact.

    Raises:
        InputError: The file cannot be written.
    """
    lines = [",".join(_COLUMNS)]
    for each in estimates:
        R = " ".join(map(repr, each.T[:3, :3].ravel().tolist()))
        t = " ".join(map(repr, (1e3 * each.T[:3, 3]).tolist()))
        lines.append(f"{','.join(map(str, each.where))},{float(each.score)!r},{R},{t},{float(each.time_s)!r}")
    write_file(path, "\n".join([*lines, ""]))


def check_rows(rows: PoseRows) -> PoseRows:
    """Return the rows if every pose is plausible.

    Raises:
        InputError: A matrix is no rotation, the unit is not mm, or a row is repeated.
    """
    square = np.abs(rows.R @ np.swapaxes(rows.R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = (square > _NOT_A_ROTATION) | (np.linalg.det(rows.R) < 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        fault = f"R R^t differs from the identity by {square[k]:.3g}" if square[k] > _NOT_A_ROTATION else "it mirrors"
        raise InputError(f"{rows.location(k)}, R: a rotation matrix, row by row, is needed; {fault}.")
    distance = np.linalg.norm(rows.t_mm, axis=1)
    require(
        np.median(distance) >= _METRES,
        f"{rows.location(0)}, t: millimetres are needed, and the median distance to the camera is "
        f"{np.median(distance):.3g}; if these are metres, multiply by 1000.",
    )
    cells = np.concatenate([rows.where, rows.t_mm, rows.R.reshape(-1, 9)], axis=1)
    again = np.setdiff1d(np.arange(len(cells)), np.unique(cells, axis=0, return_index=True)[1])
    if again.size:
        raise InputError(f"{rows.location(int(again[0]))}: an earlier row stands there once more; keep one of the two.")
    return rows


def _read_row(text: str, place: str) -> list[float]:
    """Return scene, image, object, score, the twelve numbers of R and t, and the time of one line.

    Args:
        text: The line.
        place: Its location, for messages.
    """
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
