"""Convert the tables of a log to times and poses, camera from model, by the conventions of the camera file."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.log_columns import (
    AXIS_AND_ANGLE,
    MATRIX,
    NUMBERED_QUATERNION,
    POSITION,
    QUANTITIES,
    QUATERNION,
    ROTATION_VECTOR,
    ROTATIONS,
    UNITS,
)
from apo_bench.importers.recording.log_tables import LogTable
from apo_bench.importers.recording.tracks import FARTHEST_M, FASTEST_S, NEAREST_M, SLOWEST_S, LogRows

_LARGEST = 1e20  # of any number in a log
_LENGTH_TOLERANCE = 0.02
"""The norm of a quaternion, an axis or a row of a matrix may differ from 1 by this."""
_NO = ("0", "0.0", "false", "no", "n", "f", "lost", "none", "")  # cells of a column such as `valid` for a lost frame
_EMPTY = ("", "nan", "none", "null")  # cells of a frame without a pose
_TEXTS = ("id", "valid", "lost")  # columns that hold no numbers
_FEWEST_GOOD = 0.5
"""Least share of the cells of a column that are numbers, and of rotations that are rotations."""


def read_rows(table: LogTable, how: Conventions) -> LogRows:
    """Read times, ids and poses from a table; poses keep the direction and the handedness of the file.

    Rows whose cells are no finite numbers, whose rotation is none, or that a column marks as not valid, are lost.

    Raises:
        InputError: A unit or the order of a quaternion is not stated, or most cells of a column are no numbers.
    """
    table = _select_scene(table, how)
    n = len(table.places)
    cells = {meaning: _read_numbers(table, meaning) for meaning in table.cells if meaning not in _TEXTS}
    ids = [str(cell).strip("/") for cell in table.cells.get("id", [table.name] * n)]
    no = {
        name: np.array([str(x).strip().lower() in _NO for x in table.cells[name]])
        for name in ("valid", "lost")
        if name in table.cells
    }
    position = np.column_stack([cells[name] for name in POSITION])
    scale, note = _find_length_unit(table, position, how)
    R, is_rotation, note_R = _read_rotations(table, cells, how)
    t, notes = _read_times(table, ids, cells, how)
    lost = no.get("valid", np.zeros(n, dtype=np.bool_)) | ~no.get("lost", np.ones(n, dtype=np.bool_))
    lost |= ~(np.isfinite(position).all(axis=1) & is_rotation & np.isfinite(t))
    T = np.tile(np.eye(4), (n, 1, 1))
    T[~lost] = pose.rigid(R[~lost], scale * position[~lost])
    return LogRows(ids, t, T, lost, cells.get("score", np.zeros(n)), table.places, [table.form, note, note_R, *notes])


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


def _select_scene(table: LogTable, how: Conventions) -> LogTable:
    """Return the rows of one scene of BOP results; other tables unchanged."""
    if "scene" not in table.cells:
        return table
    of = _read_numbers(table, "scene")
    scenes = np.unique(of)
    scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
    require(
        scene in scenes,
        f"{table.file}: a recording is one scene, and the file holds "
        f"{', '.join(f'{x:.0f}' for x in scenes[:6].tolist())}; state `scene` in the camera file.",
    )
    kept = np.flatnonzero(of == scene).tolist()
    cells = {meaning: [own[i] for i in kept] for meaning, own in table.cells.items()}
    return table._replace(cells=cells, places=[table.places[i] for i in kept])


def _read_numbers(table: LogTable, meaning: str) -> Array:
    """Return the cells of a column as numbers, (n,), NaN where they are none; most of them must be numbers or empty."""
    cells = table.cells[meaning]
    numbers = np.array([_read_number(cell) for cell in cells])
    numbers[~(np.abs(numbers) <= _LARGEST)] = np.nan
    words = [i for i, cell in enumerate(cells) if np.isnan(numbers[i]) and str(cell).strip().lower() not in _EMPTY]
    if len(words) > (1.0 - _FEWEST_GOOD) * len(cells):
        given = one_line(str(cells[words[0]]), 40)
        raise InputError(f"{table.places[words[0]]}, column {meaning}: a number is needed, '{given}' was given.")
    return numbers


def _read_number(cell: Any) -> float:
    """Return a cell as a number; NaN if it is none."""
    try:
        return float(cell)
    except (ValueError, TypeError, OverflowError):
        return np.nan


def _find_length_unit(table: LogTable, position: Array, how: Conventions) -> tuple[float, str]:
    """Return the factor to metres: as the header or the camera file states, else as the distances suggest."""
    unit = table.columns["x"].unit or how.length
    if unit:
        return UNITS["length"][unit], f"lengths in {unit}"
    distance = float(np.nanmedian(np.linalg.norm(position, axis=1))) if np.isfinite(position).any() else np.nan
    fits = [unit for unit in ("m", "mm") if NEAREST_M <= distance * UNITS["length"][unit] <= FARTHEST_M]
    require(
        fits,
        f"{table.file}: the unit of the column 'x' is not known; end its name with _mm, _cm or _m, or state `length` "
        "in the camera file.",
    )
    return UNITS["length"][fits[0]], f"lengths taken for {fits[0]}, as no unit is stated"


def _read_times(
    table: LogTable, ids: Sequence[str], cells: dict[str, Array], how: Conventions
) -> tuple[Array, list[str]]:
    """Return the time of each row, (n,), [s]: from its column, or from its image number and the rate of images."""
    if "sec" in cells:
        return cells["sec"] + 1e-9 * cells.get("nanosec", np.zeros(len(ids))), []
    if "t" in cells:
        t = cells["t"]
        unit = table.columns["t"].unit or how.time
        if unit:
            return t * UNITS["time"][unit], []
        # Rows of different objects may share a time, so steps within an object count.
        steps = np.concatenate([np.diff(t[np.array(ids) == name]) for name in sorted({*ids})])
        step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else SLOWEST_S
        fits = [unit for unit, factor in UNITS["time"].items() if FASTEST_S <= step * factor <= SLOWEST_S]
        unit = (fits or ["s"])[0]
        return t * UNITS["time"][unit], [f"times taken for {unit}"] * (unit != "s")
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
    names, codes = np.unique(ids, return_inverse=True)
    images = np.zeros(len(ids))
    if np.count_nonzero(np.diff(codes)) == len(names) - 1:
        for code in range(len(names)):
            images[codes == code] = np.arange(np.sum(codes == code))
        return images
    in_image = set[str]()
    for i, name in enumerate(ids):
        images[i] = images[i - 1] + (name in in_image) if i else 0.0
        in_image = {name} if name in in_image else {*in_image, name}
    return images


def _read_rotations(table: LogTable, cells: dict[str, Array], how: Conventions) -> tuple[Array, NDArray[np.bool_], str]:
    """Return rotation matrices, (n, 3, 3), which rows hold one, (n,), and a note on the convention that was used."""
    names = next(names for names in ROTATIONS if cells.keys() >= {*names})
    values = np.column_stack([cells[name] * _find_angle_unit(table, name, how) for name in names])
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
    values = np.where(finite[:, None], values, 0.0)
    if names == MATRIX:
        R = values.reshape(-1, 3, 3)
        skew = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
        good = (skew <= _LENGTH_TOLERANCE) & (np.linalg.det(R) > 0.0)
        _check_share(good, finite, table, "a rotation matrix, row by row")
        R = np.where(good[:, None, None], R, np.eye(3))
        return pose.nearest_rotations(R), good, "rotation matrices, row by row"
    if names in (QUATERNION, NUMBERED_QUATERNION):
        order = "wxyz" if names == QUATERNION else how.quaternion
        require(order, f'{table.file}: q0 to q3 have no stated order; state `quaternion = "wxyz"` in the camera file.')
        good = _have_unit_length(values, finite, table, "a quaternion of length 1")
        values = np.where(good[:, None], values, 1.0)
        return Rotation.from_quat(values, scalar_first=order == "wxyz").as_matrix(), good, f"quaternions as {order}"
    if names == ROTATION_VECTOR:
        return Rotation.from_rotvec(values).as_matrix(), finite, "rotation vectors"
    if names == AXIS_AND_ANGLE:
        good = _have_unit_length(values[:, :3], finite, table, "an axis of length 1")
        return Rotation.from_rotvec(values[:, :3] * values[:, 3:]).as_matrix(), good, "axis and angle"
    if how.euler is None:
        raise InputError(f'{table.file}: Euler angles have no stated order; state `euler = "xyz"` in the camera file.')
    return Rotation.from_euler(how.euler, values).as_matrix(), finite, f"Euler angles as {how.euler}"


def _find_angle_unit(table: LogTable, meaning: str, how: Conventions) -> float:
    """Return the factor from the unit of a column to radians; 1 for a column that is no angle."""
    if QUANTITIES.get(meaning) != "angle":
        return 1.0
    unit = table.columns[meaning].unit or how.angle
    if not unit:
        raise InputError(
            f"{table.file}: the unit of the column '{meaning}' is not known; end its name with _deg or _rad, or "
            "state `angle` in the camera file."
        )
    return UNITS["angle"][unit]


def _have_unit_length(vectors: Array, finite: NDArray[np.bool_], table: LogTable, needed: str) -> NDArray[np.bool_]:
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
