"""Convert the table of a log to times and poses in metres, camera from model, by the conventions of the camera file."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording import log_columns
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.log_columns import LogColumn, find_column
from apo_bench.importers.recording.log_tables import LogTable
from apo_bench.importers.recording.tracks import LogRows

_LARGEST = 1e20  # of any number in a log
_LENGTH_TOLERANCE = 0.02
"""The norm of a quaternion, an axis or a row of a matrix may differ from 1 by this."""


def read_rows(table: LogTable, how: Conventions) -> LogRows:
    """Read times, ids and poses from a table; poses keep the direction and the handedness of the file.

    Raises:
        InputError: A column is missing, twice or without a unit, or a cell is not a finite number.
    """
    ids, cells = _read_columns(table, how)
    for name in log_columns.POSITION:
        require(
            name in cells, f"{table.file}: the column '{name}_mm' is missing; name it in `columns` of the camera file."
        )
    T = np.tile(np.eye(4), (len(ids), 1, 1))
    T[:, :3, 3] = _stack(cells, log_columns.POSITION)
    T[:, :3, :3], note = _read_rotations(table, cells, how)
    return LogRows(ids, _read_times(table, ids, cells, how), T, table.places, [note])


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


def _read_columns(table: LogTable, how: Conventions) -> tuple[list[str], dict[str, Array]]:
    """Return the id of each row, and the other known columns by meaning, (n,), in m, rad, s."""
    names = [name.strip().lower() for name in table.names]
    renamed = {theirs.strip().lower(): ours for ours, theirs in how.columns.items()}
    for theirs, ours in renamed.items():
        place = f"{table.file}: the camera file, log.columns"
        require_known("column", theirs, names, place=place)
        require(find_column(ours), f"{place}: '{one_line(ours, 40)}' has no meaning; use names such as id, t_s, x_mm.")
    ids = [table.file.stem] * len(table.rows)
    cells: dict[str, Array] = {}
    for i, name in enumerate(names):
        column = find_column(renamed.get(name, name))
        given = [row[i] for row in table.rows]
        if column is not None and column.meaning == "id":
            ids = [str(cell) for cell in given]
        elif column is not None:
            require(
                column.meaning not in cells,
                f"{table.file}: two columns mean '{column.meaning}'; keep one, or rename the other.",
            )
            cells[column.meaning] = _finite_numbers(given, table, name) * _factor(table, column, how)
    return ids, cells


def _factor(table: LogTable, column: LogColumn, how: Conventions) -> float:
    """Return the factor from the unit of a column to m, rad or s."""
    quantity = log_columns.QUANTITIES.get(column.meaning)
    if quantity is None:
        return 1.0
    factors = log_columns.UNITS[quantity]
    unit = column.unit or getattr(how, quantity)
    require(
        unit in factors,
        f"{table.file}: the unit of the column '{column.meaning}' is not known; end its name with one of "
        f"_{', _'.join(factors)}, or state `{quantity}` in the camera file.",
    )
    return factors[unit]


def _finite_numbers(cells: Sequence[Any], table: LogTable, column: str) -> Array:
    """Return the cells of a column as numbers, (n,); raise InputError at a cell that is no finite number."""
    numbers = np.array([_number(cell) for cell in cells])
    wrong = np.flatnonzero(~(np.abs(numbers) <= _LARGEST))
    if len(wrong):
        place = f"{table.places[wrong[0]]}, column {one_line(column, 40)}"
        given = one_line(str(cells[wrong[0]]), 40)
        raise InputError(f"{place}: a finite number is needed, '{given}' was given; leave out such rows.")
    return numbers


def _number(cell: Any) -> float:
    """Return a cell as a number; NaN if it is none."""
    try:
        return float(cell)
    except (ValueError, TypeError, OverflowError):
        return np.nan


def _read_times(table: LogTable, ids: Sequence[str], cells: Mapping[str, Array], how: Conventions) -> Array:
    """Return the time of each row, (n,), [s]: from its column, or from its image number and the image rate."""
    if "seconds" in cells:
        return cells["seconds"] + 1e-9 * cells.get("nanoseconds", np.zeros(len(ids)))
    if "stamp" in cells:
        # ROS writes a stamp in a single number as whole nanoseconds.
        stamp = cells["stamp"]
        return stamp * 1e-9 if (stamp == np.round(stamp)).all() else stamp
    if "t" in cells:
        return cells["t"]
    if how.rate_hz is None:
        raise InputError(
            f"{table.file}: the column of the time is missing, such as t_s; name it in `columns` of the camera file, "
            "or state `rate_hz` there for images at a constant rate."
        )
    return (cells["frame"] if "frame" in cells else _count_images(ids)) / how.rate_hz


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


def _read_rotations(table: LogTable, cells: Mapping[str, Array], how: Conventions) -> tuple[Array, str]:
    """Return rotation matrices, (n, 3, 3), and a note on the convention that was used."""
    found = [names for names in log_columns.ROTATIONS if cells.keys() >= set(names)]
    require(
        len(found) == 1,
        f"{table.file}: the columns of one rotation are needed, {len(found)} are complete; allowed are qw to qz, q0 to "
        "q3, rx to rz, ax to az with angle, roll, pitch and yaw, e1 to e3, or r11 to r33.",
    )
    names = found[0]
    values = _stack(cells, names)
    if names == log_columns.MATRIX:
        R = values.reshape(-1, 3, 3)
        skew = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
        _refuse((skew > _LENGTH_TOLERANCE) | (np.linalg.det(R) < 0.0), table, "a rotation matrix, row by row")
        return pose.nearest_rotations(R), "rotation matrices, row by row"
    if names in (log_columns.QUATERNION, log_columns.NUMBERED_QUATERNION):
        order = "wxyz" if names == log_columns.QUATERNION else how.quaternion
        require(order, f'{table.file}: q0 to q3 have no stated order; state `quaternion = "wxyz"` in the camera file.')
        _check_unit_length(values, table, "a quaternion")
        return Rotation.from_quat(values, scalar_first=order == "wxyz").as_matrix(), f"quaternions as {order}"
    if names == log_columns.ROTATION_VECTOR:
        return Rotation.from_rotvec(values).as_matrix(), "rotation vectors"
    if names == log_columns.AXIS_AND_ANGLE:
        _check_unit_length(values[:, :3], table, "an axis")
        return Rotation.from_rotvec(values[:, :3] * values[:, 3:]).as_matrix(), "axis and angle"
    if how.euler is None:
        raise InputError(f'{table.file}: Euler angles have no stated order; state `euler = "xyz"` in the camera file.')
    return Rotation.from_euler(how.euler, values).as_matrix(), f"Euler angles as {how.euler}"


def _stack(cells: Mapping[str, Array], names: Sequence[str]) -> Array:
    """Return the named columns side by side, (n, k)."""
    return np.column_stack([cells[name] for name in names])


def _check_unit_length(vectors: Array, table: LogTable, kind: str) -> None:
    """Raise InputError unless vectors, (n, k), have length 1.

    Args:
        kind: Name of such a vector, for the message.
    """
    _refuse(np.abs(np.linalg.norm(vectors, axis=1) - 1.0) > _LENGTH_TOLERANCE, table, f"{kind} of length 1")


def _refuse(wrong: Array, table: LogTable, needed: str) -> None:
    """Raise InputError at the first wrong row of a mask, (n,).

    Args:
        needed: What the message asks for.
    """
    if wrong.any():
        raise InputError(f"{table.places[int(np.argmax(wrong))]}: {needed} is needed.")
