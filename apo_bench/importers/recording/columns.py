"""Columns of numbers become poses: positions, quaternions, rotation vectors, Euler angles, matrices."""

from collections.abc import Collection, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.camera_file import Conventions

_LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_ANGLE_UNITS = {"deg": np.pi / 180.0, "rad": 1.0}
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_UNITS = {**_LENGTH_UNITS, **_ANGLE_UNITS, **_TIME_UNITS}
_SAME = {
    **dict.fromkeys(("id", "object", "object_id", "part", "name", "track", "track_id", "body", "child_frame_id"), "id"),
    **dict.fromkeys(("t", "time", "timestamp", "stamp"), "t"),
    **{f"{letter}{axis}": axis for letter in ("t", "p", "pos_") for axis in "xyz"},
    **{f"m{i}{j}": f"r{i + 1}{j + 1}" for i in range(3) for j in range(3)},
    **{f"rot_{axis}": f"r{axis}" for axis in "xyz"},
    **{f"q_{axis}": f"q{axis}" for axis in "wxyz"},
    "frame_id": "header frame",
}
_POSITION = ("x", "y", "z")
_ROTATIONS: Mapping[str, tuple[str, ...]] = {
    "quaternion": ("qw", "qx", "qy", "qz"),
    "quaternion by number": ("q0", "q1", "q2", "q3"),
    "rotation vector": ("rx", "ry", "rz"),
    "axis and angle": ("ax", "ay", "az", "angle"),
    "Euler angles": ("roll", "pitch", "yaw"),
    "Euler angles by number": ("e1", "e2", "e3"),
    "matrix": tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
}
_KNOWN = {"id", "t", "frame", *_POSITION, *(name for names in _ROTATIONS.values() for name in names)}
_LENGTH_ONE = 0.02
"""A quaternion, an axis or a row may differ from length 1 by so much."""


class LogColumn(NamedTuple):
    """What a column is, and the unit in its name."""

    meaning: str
    unit: str


class Numbers(NamedTuple):
    """The columns of a file that mean something."""

    file: str
    cells: Mapping[str, Array]
    """Meaning -> (n,), as written."""
    units: Mapping[str, str]
    """Meaning -> unit in its name, or empty."""
    ids: Sequence[str]
    places: Sequence[str]
    """`file, line 3` of each row."""


def column(name: str) -> LogColumn | None:
    """What a column of this name is; None if it is nobody's business."""
    name = name.strip().lower()
    stem, _, unit = name.rpartition("_")
    if not stem or unit not in _UNITS:
        stem = name
        unit = ""
    meaning = _SAME.get(stem, stem)
    return LogColumn(meaning, unit) if meaning in _KNOWN else None


def row_times(numbers: Numbers, how: Conventions) -> Array:
    """The time of every row, (n,), [s]; of rows without a time and a number of their image by the rate of images."""
    cells = numbers.cells
    if "t" in cells:
        return cells["t"] * _TIME_UNITS[numbers.units["t"] or how.time]
    if how.rate_hz is not None:
        return (cells["frame"] if "frame" in cells else _count_images(numbers.ids)) / how.rate_hz
    raise InputError(
        f"{numbers.file}: the column of the time is missing, such as t_s; name it in `columns` of the camera file, or "
        "state `rate_hz` there if rows have the number of their image, or every image has one row of each id."
    )


def _count_images(ids: Sequence[str]) -> Array:
    """The number of the image of every row, (n,), from 0: a new one begins where an id stands again.

    Of rows that are sorted by id each id counts its own.
    """
    blocks = [name for name, _ in groupby(ids)]
    images = np.zeros(len(ids))
    there: set[str] = set()
    for i, name in enumerate(ids):
        new_block = len(blocks) == len(set(blocks)) and i > 0 and name != ids[i - 1]
        images[i] = 0.0 if i == 0 or new_block else images[i - 1] + (name in there)
        there = {name} if name in there else there | {name}
    return images


def read_poses(numbers: Numbers, how: Conventions) -> tuple[Array, list[str]]:
    """Poses (n, 4, 4), [m], and how they were read."""
    for name in _POSITION:
        require(
            name in numbers.cells,
            f"{numbers.file}: the column '{name}_mm' is missing; name it in `columns` of the camera file.",
        )
    unit = _one_unit("length", _LENGTH_UNITS, how.length, _POSITION, numbers)
    T = np.tile(np.eye(4), (len(numbers.ids), 1, 1))
    T[:, :3, 3] = np.column_stack([numbers.cells[name] for name in _POSITION]) * _LENGTH_UNITS[unit]
    T[:, :3, :3], rotation = _read_rotations(numbers, how)
    return T, [f"lengths in {unit}", rotation]


def orient(T: Array, how: Conventions) -> tuple[Array, list[str]]:
    """Camera from model, in right-handed axes, and what was done for it."""
    notes = []
    if how.mirror:
        T = T * mirror(how.mirror)
        notes = [f"mirrored along {how.mirror}, as stated"]
    if how.inverted:
        T = pose.inverse(T)
        notes = [*notes, "poses of the camera in the model, as stated, inverted"]
    return T, notes


def mirror(axis: str) -> Array:
    """What the elements of a pose are multiplied by to count the other way along an axis, (4, 4)."""
    flip = np.ones(4)
    flip["xyz".index(axis)] = -1.0
    return np.outer(flip, flip)


def _one_unit(kind: str, allowed: Collection[str], stated: str | None, names: Sequence[str], numbers: Numbers) -> str:
    """The unit that all of these columns have."""
    units = {name: numbers.units[name] or stated for name in names}
    for name, unit in units.items():
        require(
            unit is not None,
            f"{numbers.file}: the unit of the column '{name}' is not known; name it {name}_{next(iter(allowed))}, or "
            f"state `{kind}` in the camera file.",
        )
    unit, *others = {str(unit) for unit in units.values()}
    require(
        unit in allowed and not others,
        f"{numbers.file}: the columns {', '.join(names)} need one unit of {kind}, all the same: {', '.join(allowed)}.",
    )
    return unit


def _read_rotations(numbers: Numbers, how: Conventions) -> tuple[Array, str]:
    from scipy.spatial.transform import Rotation

    kind = _rotation_of(numbers)
    names = _ROTATIONS[kind]
    values = np.column_stack([numbers.cells[name] for name in names])
    if kind == "matrix":
        return _nearest(values.reshape(-1, 3, 3), numbers.places), "rotation matrices, row by row"
    if kind.startswith("quaternion"):
        order = "wxyz" if kind == "quaternion" else how.quaternion
        require(
            order is not None,
            f'{numbers.file}: q0 to q3 do not say their order; state `quaternion = "wxyz"` or "xyzw" in the camera '
            "file.",
        )
        check_length(values, "a quaternion", numbers.places)
        by = "by the names of the columns" if kind == "quaternion" else f"in the order {order}, as stated"
        return Rotation.from_quat(values, scalar_first=order == "wxyz").as_matrix(), f"quaternions {by}"
    unit = _one_unit("angle", _ANGLE_UNITS, how.angle, names[-1:] if kind == "axis and angle" else names, numbers)
    if kind == "axis and angle":
        check_length(values[:, :3], "an axis", numbers.places)
        values = values[:, :3] * values[:, 3:]
    if not kind.startswith("Euler"):
        words = "rotation vectors" if kind == "rotation vector" else kind
        return Rotation.from_rotvec(values * _ANGLE_UNITS[unit]).as_matrix(), f"{words} in {unit}"
    if how.euler is None:
        raise InputError(
            f'{numbers.file}: Euler angles do not say their order; state `euler = "xyz"` in the camera file.'
        )
    about = "fixed" if how.euler.islower() else "moving"
    R = Rotation.from_euler(how.euler, values * _ANGLE_UNITS[unit]).as_matrix()
    return R, f"Euler angles in {unit}, {how.euler} about {about} axes, as stated"


def _rotation_of(numbers: Numbers) -> str:
    """The only kind of rotation whose columns are all there."""
    kinds = [kind for kind, names in _ROTATIONS.items() if all(name in numbers.cells for name in names)]
    if len(kinds) == 1:
        return kinds[0]
    # Of none: what is missing of the rotation of which most columns are there.
    most = max(_ROTATIONS.values(), key=lambda names: sum(name in numbers.cells for name in names) / len(names))
    some, missing = (", ".join(name for name in most if (name in numbers.cells) is has) for has in (True, False))
    there = " and ".join(kinds) + " are there" if kinds else f"{missing} is missing beside {some or 'the position'}"
    raise InputError(
        f"{numbers.file}: columns of one rotation are needed, {there}; allowed are qw to qz, q0 to q3, rx to rz, ax to "
        "az with angle, roll, pitch and yaw, e1 to e3, or r11 to r33, or other names by `columns` of the camera file."
    )


def _nearest(R: Array, places: Sequence[str]) -> Array:
    """The nearest rotations."""
    square = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    _refuse((square > _LENGTH_ONE) | (np.linalg.det(R) < 0.0), places, "a rotation matrix, row by row, is needed")
    return pose.nearest_rotations(R)


def check_length(vectors: Array, what: str, places: Sequence[str]) -> None:
    """Refuse vectors (n, k) that are not of length 1; the first one is named."""
    wrong = np.abs(np.linalg.norm(vectors, axis=1) - 1.0) > _LENGTH_ONE
    _refuse(wrong, places, f"{what} of length 1 is needed")


def _refuse(wrong: Array, places: Sequence[str], needed: str) -> None:
    if wrong.any():
        raise InputError(f"{places[int(np.argmax(wrong))]}: {needed}.")
