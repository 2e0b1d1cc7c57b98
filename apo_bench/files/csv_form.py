"""Observed poses as comma-separated values: one row per operation, columns known by their names.

    operation,part,x_mm,y_mm,z_mm,qw,qx,qy,qz,deviation_mm,deviation_deg,seen

The unit stands in the name: lengths in `_mm` or `_m`, angles in `_deg` or `_rad`. The order of the columns is free,
that of the quaternion too. The last three may be left out, as columns or in single rows: standard deviations along and
about each axis of the part (then those that are assumed), and whether the operation was seen (then it was). One more
column, `play_mm`, is the room that parts which fit have per side (else the scenario's clearance), the same in each row.

How small and how large a standard deviation may be, wherever one is stated.
"""

import csv
import io
import math
from collections.abc import Sequence
from math import pi
from pathlib import Path

import numpy as np

from apo_bench.assembly import Assembly, Observation
from apo_bench.errors import InputError, require
from apo_bench.geometry import FARTHEST_M, Array, pose
from apo_bench.io import Columns, CsvRow, read_csv
from apo_bench.scenario import Scenario, layout_at

DEVIATION_MM = 1.0
DEVIATION_DEG = 1.0
"""What is assumed where a file states no standard deviations."""
SHIFT_M = (1e-7, 10.0)
TURN_RAD = (1e-4 * pi / 180.0, pi)
"""Least and greatest standard deviation, [m] and [rad]: within, ranks and gaps are told from rounding."""
ALLOWED_DEVIATIONS = "standard deviations from 0.0001 to 10000 mm and from 0.0001 to 180 deg are allowed"
_ROUNDING = 1e-9


def check_deviations(deviation_mm: float, deviation_deg: float) -> None:
    """Refuse standard deviations that make no sense.

    Raises:
        InputError: One is too small, too large, or no number.
    """
    for name, deviation, size, limits in (
        ("deviation_mm", deviation_mm, 1e-3, SHIFT_M),
        ("deviation_deg", deviation_deg, pi / 180.0, TURN_RAD),
    ):
        number = isinstance(deviation, int | float | np.floating | np.integer) and not isinstance(deviation, bool)
        if not number or not is_within(deviation * size, limits):
            text = f"{deviation:g}" if number else repr(deviation)
            low, high = (x / size for x in limits)
            raise InputError(f"{name} {text} was given; a number from {low:g} to {high:g} is allowed.")


def assumed_deviations(deviation_mm: float | None, deviation_deg: float | None) -> str:
    """What is said where a file states no standard deviations; None stands for the default."""
    mm = DEVIATION_MM if deviation_mm is None else deviation_mm
    deg = DEVIATION_DEG if deviation_deg is None else deviation_deg
    return f"a standard deviation of {mm:g} mm and {deg:g} deg per axis, assumed where the file states none"


def is_within(deviation: float, limits: tuple[float, float]) -> bool:
    """Whether a standard deviation, [m] or [rad], is between its limits; a NaN is not."""
    return limits[0] * (1.0 - _ROUNDING) <= deviation <= limits[1] * (1.0 + _ROUNDING)


def is_sensible(covariance: Array) -> bool:
    """Whether every variance of a body twist, on the diagonal of (6, 6) [m, rad], is that of such a deviation."""
    deviations = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    return all(is_within(float(x), SHIFT_M if i < 3 else TURN_RAD) for i, x in enumerate(deviations))


_POSITION = ("x", "y", "z")
_QUATERNION = ("qw", "qx", "qy", "qz")
_LENGTHS = {"mm": 1e-3, "m": 1.0}
_ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}
_COLUMNS: Columns = {
    **{name: (name, 1.0) for name in ("operation", "part")},
    **{f"{name}_{unit}": (name, size) for name in _POSITION for unit, size in _LENGTHS.items()},
    **{name: (name, 1.0) for name in _QUATERNION},
    **{f"deviation_{unit}": ("deviation", size) for unit, size in _LENGTHS.items()},
    **{f"deviation_{unit}": ("turn deviation", size) for unit, size in _ANGLES.items()},
    "seen": ("seen", 1.0),
    **{f"play_{unit}": ("play", size) for unit, size in _LENGTHS.items()},
}
"""What a column stands for, and its unit in m or rad."""
_REQUIRED = ("operation", "part", *_POSITION, *_QUATERNION)
_FLAGS = {"true": True, "yes": True, "1": True, "": True, "false": False, "no": False, "0": False}


def read_table(
    path: str | Path,
    scenario: Scenario,
    *,
    deviation_mm: float = DEVIATION_MM,
    deviation_deg: float = DEVIATION_DEG,
) -> tuple[Observation, bool]:
    """An observation from a CSV file, and whether a standard deviation had to be assumed.

    Parts start where those of the scenario do.

    Raises:
        InputError: Anything in the file that is not as described, naming line and column.
    """
    assembly = scenario.assembly
    rows = dict[int, CsvRow]()
    for row in read_csv(path, _COLUMNS, _REQUIRED):
        k = _operation(row, assembly)
        if k in rows:
            row.fail("operation", f"every operation stands once, this one is in line {rows[k].line} already")
        rows[k] = row
    for k, operation in enumerate(assembly.operations):
        require(
            k in rows,
            f"{path}: the row of operation {k + 1} ({operation.main}) is missing; "
            f"give one row for each of the {len(assembly)} operations.",
        )
    ordered = [rows[k] for k in range(len(assembly))]
    shift = [_deviation(row, "deviation", deviation_mm * 1e-3, SHIFT_M) for row in ordered]
    turn = [_deviation(row, "turn deviation", math.radians(deviation_deg), TURN_RAD) for row in ordered]
    stated = all(row.text("deviation") and row.text("turn deviation") for row in ordered)
    observation = Observation(
        assembly=assembly,
        start=layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start,
        goals=np.array([_pose(row) for row in ordered]).reshape(-1, 4, 4),
        covariance=np.array([np.diag([s] * 3 + [t] * 3) ** 2 for s, t in zip(shift, turn, strict=True)]).reshape(
            -1, 6, 6
        ),
        seen=np.array([_flag(row) for row in ordered], dtype=np.bool_),
        gap_m=scenario.gap_mm * 1e-3,
        play_m=_play(ordered, scenario.clearance_mm * 1e-3),
    )
    return observation, not stated


def table(assembly: Assembly, goals: Array) -> str:
    """Goals (n, 4, 4) as such a table, in mm, numbers to the last digit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["operation", "part", *(f"{name}_mm" for name in _POSITION), *_QUATERNION])
    for k, (operation, T) in enumerate(zip(assembly.operations, goals, strict=True)):
        packed = pose.pack(T) * [1e3, 1e3, 1e3, 1, 1, 1, 1]
        writer.writerow([k + 1, operation.main, *map(repr, packed.tolist())])
    return text.getvalue()


def _operation(row: CsvRow, assembly: Assembly) -> int:
    """Which operation a row is of, counted from 0."""
    text = row.text("operation")
    row.require(
        text.isdecimal() and len(text) <= 9 and 1 <= int(text) <= len(assembly),
        "operation",
        f"a whole number from 1 to {len(assembly)} is needed",
    )
    k = int(text) - 1
    row.require(
        row.text("part") == assembly.operations[k].main,
        "part",
        f"'{assembly.operations[k].main}' is needed, the part that operation {k + 1} moves",
    )
    return k


def _pose(row: CsvRow) -> Array:
    position = [row.number(name, FARTHEST_M) for name in _POSITION]
    x, *others = (row.cells[name] for name in _POSITION)
    for other in others:
        require(
            other[2] == x[2],
            f"{row.file}: the columns '{x[0]}' and '{other[0]}' are of different units; "
            "give all three positions in mm, or all in m.",
        )
    q = np.array([row.number(name, 2.0) for name in _QUATERNION])
    require(
        abs(np.linalg.norm(q) - 1.0) <= 1e-3,
        f"{row.file}, line {row.line}, columns qw to qz: a quaternion of length 1 (within 0.001) is needed, "
        f"one of length {np.linalg.norm(q):.4g} was given; divide it by its length.",
    )
    return pose.unpack(np.array([*position, *q]))


def _deviation(row: CsvRow, meaning: str, assumed: float, limits: tuple[float, float]) -> float:
    """A standard deviation; the assumed one if the cell is empty."""
    if not row.text(meaning):
        return assumed
    x = row.number(meaning, math.inf)
    unit = row.cells[meaning][2]
    if not is_within(x, limits):
        low, high = (limit / unit for limit in limits)
        row.fail(meaning, f"a standard deviation from {low:g} to {high:g} is needed")
    return x


def _play(rows: Sequence[CsvRow], assumed: float) -> float:
    """The play of parts that fit, [m], which is one number for all rows."""
    stated = [(row, row.number("play", FARTHEST_M)) for row in rows if row.text("play")]
    for row, x in stated:
        row.require(x >= 0.0, "play", "a length from 0 is needed")
        row.require(
            x == stated[0][1], "play", f"one length for all rows is needed, line {stated[0][0].line} says another"
        )
    return stated[0][1] if stated else assumed


def _flag(row: CsvRow) -> bool:
    text = row.text("seen").lower()
    row.require(text in _FLAGS, "seen", "true or false is needed")
    return _FLAGS[text]
