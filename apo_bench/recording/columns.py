"""Columns of numbers become poses: positions, quaternions, rotation vectors, Euler angles, matrices."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, pose
from apo_bench.recording.setup_files import ANGLE_UNITS, LENGTH_UNITS, TIME_UNITS, Conventions

_UNITS = {**LENGTH_UNITS, **ANGLE_UNITS, **TIME_UNITS}
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
_MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
_ROTATIONS: Mapping[str, tuple[str, ...]] = {
    "quaternion": ("qw", "qx", "qy", "qz"),
    "quaternion by number": ("q0", "q1", "q2", "q3"),
    "rotation vector": ("rx", "ry", "rz"),
    "axis and angle": ("ax", "ay", "az", "angle"),
    "Euler angles": ("roll", "pitch", "yaw"),
    "Euler angles by number": ("e1", "e2", "e3"),
    "matrix": _MATRIX,
}
_KNOWN = {"id", "t", "frame", *_POSITION, *(name for names in _ROTATIONS.values() for name in names)}
_LENGTH_ONE = 0.02
"""A quaternion, an axis or a row may differ from length 1 by so much."""

_MOST_RAD = 4.0 * np.pi
"""Larger angles are none in radians."""


class LogColumn(NamedTuple):
    """What a column is, and the unit in its name."""

    meaning: str
    unit: str


def column(name: str) -> LogColumn | None:
    """What a column of this name is; None if it is nobody's business."""
    name = name.strip().lower()
    stem, _, unit = name.rpartition("_")
    if not stem or unit not in _UNITS:
        stem = name
        unit = ""
    meaning = _SAME.get(stem, stem)
    return LogColumn(meaning, unit) if meaning in _KNOWN else None


def row_times(
    cells: Mapping[str, Array], units: Mapping[str, str], how: Conventions, file: str, ids: Sequence[str]
) -> Array:
    """The time of every row, (n,), [s]; of rows without a time and a number of their image by the rate of images."""
    if "t" in cells:
        return cells["t"] * TIME_UNITS[units["t"] or how.time]
    if how.rate_hz is not None:
        return (cells["frame"] if "frame" in cells else counted_images(ids)) / how.rate_hz
    require("frame" not in cells, f"{file}: images are numbered and have no time; state `rate_hz` in the camera file.")
    raise InputError(
        f"{file}: the column of the time is missing, such as t_s; name it in `columns` of the camera file, or state "
        "`rate_hz` there if every image has one row of each id."
    )


def counted_images(ids: Sequence[str]) -> Array:
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


def poses(
    cells: Mapping[str, Array], units: Mapping[str, str], how: Conventions, file: str, places: Sequence[str]
) -> tuple[Array, list[str]]:
    """Poses (n, 4, 4), [m], and how they were read.

    Args:
        cells: Meaning -> (n,), as written.
        units: Meaning -> unit in its name, or empty.
        places: Where each row stands, for messages.
    """
    for name in _POSITION:
        require(name in cells, f"{file}: the column '{name}_mm' is missing; name it in `columns` of the camera file.")
    T = np.tile(np.eye(4), (len(cells["x"]), 1, 1))
    unit = _one_unit(_POSITION, units, how.length, "length", file)
    T[:, :3, 3] = np.column_stack([cells[name] for name in _POSITION]) * LENGTH_UNITS[unit]
    T[:, :3, :3], rotation = _rotations(cells, units, how, file, places)
    return T, [f"lengths in {unit}", rotation]


def oriented(T: Array, how: Conventions) -> tuple[Array, list[str]]:
    """Camera from model, in right-handed axes, and what was done for it."""
    notes = []
    if how.mirror:
        flip = np.ones(4)
        flip["xyz".index(how.mirror)] = -1.0
        T = T * np.outer(flip, flip)
        notes = [f"mirrored along {how.mirror}, as stated"]
    if how.inverted:
        T = pose.inverse(T)
        notes = [*notes, "poses of the camera in the model, as stated, inverted"]
    return T, notes


def _one_unit(
    names: Sequence[str], units: Mapping[str, str], stated: str | None, kind: Literal["length", "angle"], file: str
) -> str:
    """The unit that all of these columns have."""
    allowed, examples, are = {
        "length": (LENGTH_UNITS, ("mm", "m"), "positions are in {}; give all three in one unit"),
        "angle": (ANGLE_UNITS, ("deg",), "angles are in {}; give all in one unit"),
    }[kind]
    different = {name: units.get(name, "") or stated for name in names}
    for name, unit in different.items():
        require(
            unit is not None,
            f"{file}: the unit of the column '{name}' is not known; name it "
            f"{' or '.join(f'{name}_{example}' for example in examples)}, or state `{kind}` in the camera file.",
        )
        require(
            unit in allowed,
            f"{file}: the unit of '{name}_{unit}' is none of a {kind}; {', '.join(allowed)} are allowed.",
        )
    first, *others = sorted({str(unit) for unit in different.values()})
    require(not others, f"{file}: {are.format(' and '.join([first, *others]))}.")
    return first


def _rotations(
    cells: Mapping[str, Array], units: Mapping[str, str], how: Conventions, file: str, places: Sequence[str]
) -> tuple[Array, str]:
    from scipy.spatial.transform import Rotation

    kind, *others = [kind for kind, names in _ROTATIONS.items() if all(name in cells for name in names)] or [""]
    if others or not kind:
        # Of none: what is missing of the rotation of which most columns are there.
        names = max(_ROTATIONS.values(), key=lambda names: sum(name in cells for name in names) / len(names))
        some, missing = (", ".join(name for name in names if (name in cells) is has) for has in (True, False))
        there = f"{missing} is missing beside {some}" if some else "none is there"
        if others:
            there = f"{1 + len(others)} ({' and '.join([kind, *others])}) are there"
        raise InputError(
            f"{file}: columns of one rotation are needed, {there}; allowed are qw to qz, q0 to q3, rx to rz, ax to az "
            "with angle, roll, pitch and yaw, e1 to e3, or r11 to r33, or other names by `columns` of the camera file."
        )
    numbers = np.column_stack([cells[name] for name in _ROTATIONS[kind]])
    if kind.startswith("quaternion"):
        order = "wxyz" if kind == "quaternion" else how.quaternion
        require(
            order is not None,
            f'{file}: q0 to q3 do not say their order; state `quaternion = "wxyz"` or "xyzw" in the camera file.',
        )
        check_length(numbers, "a quaternion", places)
        by = "by the names of the columns" if kind == "quaternion" else f"in the order {order}, as stated"
        return Rotation.from_quat(numbers, scalar_first=order == "wxyz").as_matrix(), f"quaternions {by}"
    if kind == "matrix":
        return _matrices(numbers.reshape(-1, 3, 3), places), "rotation matrices, row by row"
    angular = ("angle",) if kind == "axis and angle" else _ROTATIONS[kind]
    unit = _one_unit(angular, units, how.angle, "angle", file)
    largest = max(float(np.abs(cells[name]).max(initial=0.0)) for name in angular)
    if unit == "rad" and largest > _MOST_RAD:
        raise InputError(
            f"{file}: angles of up to {largest:.4g} rad were given, so these seem to be degrees that were read as "
            "radians; state the unit: columns such as rx_deg, or `angle` in the camera file."
        )
    if kind == "axis and angle":
        check_length(numbers[:, :3], "an axis", places)
        numbers = numbers[:, :3] * numbers[:, 3:]
    if not kind.startswith("Euler"):
        words = "rotation vectors" if kind == "rotation vector" else kind
        return Rotation.from_rotvec(numbers * ANGLE_UNITS[unit]).as_matrix(), f"{words} in {unit}"
    if how.euler is None:
        raise InputError(f'{file}: Euler angles do not say their order; state `euler = "xyz"` in the camera file.')
    about = "fixed" if how.euler.islower() else "moving"
    turned = Rotation.from_euler(how.euler, numbers * ANGLE_UNITS[unit])
    return turned.as_matrix(), f"Euler angles in {unit}, {how.euler} about {about} axes, as stated"


def _matrices(R: Array, places: Sequence[str]) -> Array:
    """The nearest rotations."""
    square = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = (square > _LENGTH_ONE) | (np.linalg.det(R) < 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        fault = f"R R^t differs from the identity by {square[k]:.3g}" if square[k] > _LENGTH_ONE else "it mirrors"
        raise InputError(f"{places[k]}: a rotation matrix, row by row, is needed; {fault}.")
    return pose.nearest_rotations(R)


def check_length(vectors: Array, what: str, places: Sequence[str]) -> None:
    """Refuse vectors (n, k) that are not of length 1; the first one is named."""
    length = np.linalg.norm(vectors, axis=1)
    wrong = np.abs(length - 1.0) > _LENGTH_ONE
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(f"{places[k]}: {what} of length 1 is needed, one of length {length[k]:.4g} was given.")
