"""Convert the tables of a log to times and poses, camera from model, by the conventions of the camera file."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording import log_columns
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.log_columns import UNITS, LogColumn
from apo_bench.importers.recording.log_tables import LogTable
from apo_bench.importers.recording.tracks import FARTHEST_M, FASTEST_S, NEAREST_M, SLOWEST_S, LogRows

_LARGEST = 1e20  # of any number in a log
_LENGTH_TOLERANCE = 0.02
"""The norm of a quaternion, an axis or a row of a matrix may differ from 1 by this."""
_NO = ("0", "0.0", "false", "no", "n", "f", "lost", "none", "")  # cells of a column such as `valid` for a lost frame
_EMPTY = ("", "nan", "none", "null")  # cells of a frame without a pose
_FEWEST_GOOD = 0.5
"""Least share of the cells of a column that are numbers, and of rotations that are rotations."""


def read_rows(table: LogTable, how: Conventions) -> LogRows:
    """Read times, ids and poses from a table; poses keep the direction and the handedness of the file.

    Rows whose cells are no finite numbers, whose rotation is none, or that a column marks as not valid, are lost.

    Raises:
        InputError: A unit or the order of a quaternion is not stated, or most cells of a column are no numbers.
    """
    ids, cells, lost = _read_columns(table, how)
    cells = _one_scene(table, cells, how)
    kept = cells.pop("kept").astype(bool)
    ids = [name for name, keep in zip(ids, kept, strict=True) if keep]
    lost = lost[kept]
    places = [place for place, keep in zip(table.places, kept, strict=True) if keep]
    given = {column.meaning: column for column in table.columns if column is not None}
    notes = [table.form]
    position = np.column_stack([cells[name] for name in log_columns.POSITION])
    scale, note = _length_unit(table, given, position, how)
    notes += note
    R, is_rotation, note_R = _read_rotations(table, given, cells, how)
    notes.append(note_R)
    T = np.tile(np.eye(4), (len(ids), 1, 1))
    t, note = _read_times(table, given, ids, cells, how)
    lost |= ~(np.isfinite(position).all(axis=1) & is_rotation & np.isfinite(t))
    T[:, :3, 3] = np.where(lost[:, None], 0.0, position * scale)
    T[~lost, :3, :3] = R[~lost]
    score = cells.get("score", np.zeros(len(ids)))
    return LogRows(ids, t, T, lost, score, places, [*notes, *note])


def orient(T: Array, how: Conventions) -> tuple[Array, list[str]]:
    """Return poses as camera from model in right-handed axes, (n, 4, 4), and a note for each change that was stated."""
    notes = []
    if how.mirror:
        T = T * mirror(how.mirror)
        notes.append(f"mirrored along {how.mirror}, as stated")
    if how.inverted:
        T = pose.inverse(T)
        notes.append("poses of the camera in the model, as stated, inverted")
    return T, notes


def mirror(axis: str) -> Array:
    """Return factors for the elements of a pose, (4, 4), that mirror an axis, for element-wise multiplication."""
    flip = np.ones(4)
    flip["xyz".index(axis)] = -1.0
    return np.outer(flip, flip)


def _read_columns(table: LogTable, how: Conventions) -> tuple[list[str], dict[str, Array], NDArray[np.bool_]]:
    """Return the id of each row, the columns of numbers by meaning, (n,), as written, and the rows marked as lost."""
    ids = [table.name] * len(table.rows)
    cells: dict[str, Array] = {}
    lost = np.zeros(len(table.rows), dtype=np.bool_)
    for i, column in enumerate(table.columns):
        if column is None:
            continue
        given = [row[i] for row in table.rows]
        if column.meaning == "id":
            ids = [str(cell).strip("/") for cell in given]
        elif column.meaning in ("valid", "lost"):
            no = np.array([str(cell).strip().lower() in _NO for cell in given])
            lost |= no if column.meaning == "valid" else ~no
        else:
            require(
                column.meaning not in cells,
                f"{table.file}: two columns mean '{column.meaning}'; keep one, or rename the other.",
            )
            cells[column.meaning] = _numbers(given, table, column)
    return ids, cells, lost


def _numbers(cells: Sequence[Any], table: LogTable, column: LogColumn) -> Array:
    """Return the cells of a column as numbers, (n,), NaN where they are none; most of them must be numbers or empty."""
    numbers = np.array([_number(cell) for cell in cells])
    numbers[~(np.abs(numbers) <= _LARGEST)] = np.nan
    words = [i for i, cell in enumerate(cells) if np.isnan(numbers[i]) and str(cell).strip().lower() not in _EMPTY]
    if len(words) > (1.0 - _FEWEST_GOOD) * len(cells):
        given = one_line(str(cells[words[0]]), 40)
        raise InputError(f"{table.places[words[0]]}, column {column.meaning}: a number is needed, '{given}' was given.")
    return numbers


def _number(cell: Any) -> float:
    """Return a cell as a number; NaN if it is none."""
    try:
        return float(cell)
    except (ValueError, TypeError, OverflowError):
        return np.nan


def _one_scene(table: LogTable, cells: dict[str, Array], how: Conventions) -> dict[str, Array]:
    """Return the columns of numbers of one scene of BOP results, with a mask of its rows as `kept`."""
    kept = np.ones(len(table.rows), dtype=np.bool_)
    if "scene" in cells:
        scenes = np.unique(cells["scene"])
        scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
        require(
            scene in scenes,
            f"{table.file}: a recording is one scene, and the file holds "
            f"{', '.join(f'{x:.0f}' for x in scenes[:6].tolist())}; state `scene` in the camera file.",
        )
        kept = cells["scene"] == scene
    return {**{name: x[kept] for name, x in cells.items()}, "kept": kept.astype(np.float64)}


def _length_unit(
    table: LogTable, given: Mapping[str, LogColumn], position: Array, how: Conventions
) -> tuple[float, list[str]]:
    """Return the factor to metres: as the header or the camera file states, else as the distances suggest."""
    unit = given["x"].unit or how.length
    if unit:
        return UNITS["length"][unit], [f"lengths in {unit}"]
    distance = float(np.nanmedian(np.linalg.norm(position, axis=1))) if np.isfinite(position).any() else np.nan
    fits = [unit for unit in ("m", "mm") if NEAREST_M <= distance * UNITS["length"][unit] <= FARTHEST_M]
    require(
        fits,
        f"{table.file}: the unit of the column 'x' is not known; end its name with _mm, _cm or _m, or state `length` "
        "in the camera file.",
    )
    return UNITS["length"][fits[0]], [f"lengths taken for {fits[0]}, as no unit is stated"]


def _read_times(
    table: LogTable, given: Mapping[str, LogColumn], ids: Sequence[str], cells: Mapping[str, Array], how: Conventions
) -> tuple[Array, list[str]]:
    """Return the time of each row, (n,), [s]: from its column, or from its image number and the rate of images."""
    if "sec" in cells:
        return cells["sec"] + 1e-9 * cells.get("nanosec", np.zeros(len(ids))), []
    if "t" in cells:
        t = cells["t"]
        unit = given["t"].unit or how.time
        if unit:
            return t * UNITS["time"][unit], []
        # Rows of different objects may share a time, so steps within an object count.
        names = np.array(ids, dtype=object)
        steps = np.concatenate([np.diff(t[names == name]) for name in sorted({*ids})])
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else SLOWEST_S
        fits = [unit for unit, factor in UNITS["time"].items() if FASTEST_S <= step * factor <= SLOWEST_S]
        return t * UNITS["time"][(fits or ["s"])[0]], [f"times taken for {fits[0]}"] if fits and fits[0] != "s" else []
    rate = how.rate_hz or table.rate_hz
    if not rate:
        raise InputError(
            f"{table.file}: the column of the time is missing, such as t_s; name it in `columns` of the camera file, "
            "or state `rate_hz` there for images at a constant rate."
        )
    return (cells["frame"] if "frame" in cells else _count_images(ids)) / rate, [f"{rate:g} images a second"]


def _count_images(ids: Sequence[str]) -> Array:
    """Return the number of each row's image, (n,), from 0: a repeated id begins a new image.

    If the rows are sorted by id, each id counts its own images.
    """
    runs = [list(run) for _, run in groupby(ids)]
    if len(runs) == len(set(ids)):
        return np.concatenate([np.arange(len(run)) for run in runs])
    images = []
    in_image = set[str]()
    image = 0
    for name in ids:
        if name in in_image:
            image += 1
            in_image = set()
        in_image.add(name)
        images.append(image)
    return np.array(images, dtype=np.float64)


def _read_rotations(
    table: LogTable, given: Mapping[str, LogColumn], cells: Mapping[str, Array], how: Conventions
) -> tuple[Array, NDArray[np.bool_], str]:
    """Return rotation matrices, (n, 3, 3), which rows hold one, (n,), and a note on the convention that was used."""
    names = next(names for names in log_columns.ROTATIONS if cells.keys() >= {*names})
    values = np.column_stack([cells[name] * _angle_unit(table, given[name], how) for name in names])
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    values = np.where(finite[:, None], values, 0.0)
    if names == log_columns.MATRIX:
        R = values.reshape(-1, 3, 3)
        skew = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
        good = (skew <= _LENGTH_TOLERANCE) & (np.linalg.det(R) > 0.0)
        _check_share(good, finite, table, "a rotation matrix, row by row")
        return (
            pose.nearest_rotations(np.where(good[:, None, None], R, np.eye(3))),
            good,
            "rotation matrices, row by row",
        )
    if names in (log_columns.QUATERNION, log_columns.NUMBERED_QUATERNION):
        order = "wxyz" if names == log_columns.QUATERNION else how.quaternion
        require(order, f'{table.file}: q0 to q3 have no stated order; state `quaternion = "wxyz"` in the camera file.')
        good = _has_unit_length(values, finite, table, "a quaternion of length 1")
        safe = np.where(good[:, None], values, 1.0)
        return Rotation.from_quat(safe, scalar_first=order == "wxyz").as_matrix(), good, f"quaternions as {order}"
    if names == log_columns.ROTATION_VECTOR:
        return Rotation.from_rotvec(values).as_matrix(), finite, "rotation vectors"
    if names == log_columns.AXIS_AND_ANGLE:
        good = _has_unit_length(values[:, :3], finite, table, "an axis of length 1")
        return Rotation.from_rotvec(values[:, :3] * values[:, 3:]).as_matrix(), good, "axis and angle"
    if how.euler is None:
        raise InputError(f'{table.file}: Euler angles have no stated order; state `euler = "xyz"` in the camera file.')
    return Rotation.from_euler(how.euler, values).as_matrix(), finite, f"Euler angles as {how.euler}"


def _angle_unit(table: LogTable, column: LogColumn, how: Conventions) -> float:
    """Return the factor from the unit of a column to radians; 1 for a column that is no angle."""
    if log_columns.QUANTITIES.get(column.meaning) != "angle":
        return 1.0
    unit = column.unit or how.angle
    if not unit:
        raise InputError(
            f"{table.file}: the unit of the column '{column.meaning}' is not known; end its name with _deg or _rad, or "
            "state `angle` in the camera file."
        )
    return UNITS["angle"][unit]


def _has_unit_length(vectors: Array, finite: NDArray[np.bool_], table: LogTable, needed: str) -> NDArray[np.bool_]:
    """Return which vectors, (n, k), have length 1; most of those that are not zero must."""
    length = np.linalg.norm(vectors, axis=1)
    good = np.abs(length - 1.0) <= _LENGTH_TOLERANCE
    _check_share(good, finite & (length > 0.0), table, needed)
    return np.asarray(good)


def _check_share(good: NDArray[np.bool_], counted: NDArray[np.bool_], table: LogTable, needed: str) -> None:
    """Raise InputError at the first wrong row if fewer than half of the counted rows are right."""
    wrong = counted & ~good
    if wrong.sum() > (1.0 - _FEWEST_GOOD) * max(counted.sum(), 1):
        raise InputError(f"{table.places[int(np.argmax(wrong))]}: {needed} is needed.")
