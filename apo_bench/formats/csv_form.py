"""Read and write observed poses as comma-separated values.

    operation,part,x_mm,y_mm,z_mm,qw,qx,qy,qz,deviation_mm,deviation_deg,seen

Names end with the unit: lengths in `_mm` or `_m`, angles in `_deg` or `_rad`. The order of the columns is free. The
last three columns are optional, as are single cells of them. They are the standard deviations along and about each
axis of the part (default: assumed ones), and whether the operation was observed (default: true). One more column,
`play_mm`, is the clearance per side of parts that fit, equal in all rows (default: the scenario's clearance).
"""

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from apo_bench.assembly import Assembly, Observation
from apo_bench.errors import require
from apo_bench.formats.deviations import SHIFT_M, TURN_RAD, is_within
from apo_bench.geometry import FARTHEST_M, Array, pose
from apo_bench.io import Columns, CsvRow, check_quaternion, read_csv
from apo_bench.scenario import Scenario, place_layout

_POSITION = ("x", "y", "z")
_QUATERNION = ("qw", "qx", "qy", "qz")
_LENGTHS = {"mm": 1e-3, "m": 1.0}  # factors to m
_ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}  # factors to rad
_COLUMNS: Columns = {
    **{name: (name, 1.0) for name in ("operation", "part")},
    **{f"{name}_{unit}": (name, size) for name in _POSITION for unit, size in _LENGTHS.items()},
    **{name: (name, 1.0) for name in _QUATERNION},
    **{f"deviation_{unit}": ("deviation", size) for unit, size in _LENGTHS.items()},
    **{f"deviation_{unit}": ("turn deviation", size) for unit, size in _ANGLES.items()},
    "seen": ("seen", 1.0),
    **{f"play_{unit}": ("play", size) for unit, size in _LENGTHS.items()},
}
"""Name of a column -> its meaning, and the factor from its unit to m or rad."""
_REQUIRED = ("operation", "part", *_POSITION, *_QUATERNION)  # meanings that must have a column
# Values of the column `seen`.
_FLAGS = {"true": True, "yes": True, "1": True, "": True, "false": False, "no": False, "0": False}


def read_table(path: str | Path, scenario: Scenario, assumed: tuple[float, float]) -> tuple[Observation, bool]:
    """Read an observation from a CSV file; parts start as in the scenario.

    Args:
        assumed: Standard deviations, in mm and degrees, of operations that state none.

    Returns:
        The observation, and whether a standard deviation had to be assumed.

    Raises:
        InputError: The file deviates from the format; the message names line and column.
    """
    assembly = scenario.assembly
    rows = dict[int, CsvRow]()
    for row in read_csv(path, _COLUMNS, _REQUIRED):
        k = _read_operation(row, assembly)
        row.require(k not in rows, "operation", "every operation once is needed")
        rows[k] = row
    for k, operation in enumerate(assembly.operations):
        require(k in rows, f"{path}: the row of operation {k + 1} ({operation.main}) is missing.")
    ordered = [rows[k] for k in range(len(assembly))]
    shift = [_read_deviation(row, "deviation", assumed[0] * 1e-3, SHIFT_M) for row in ordered]
    turn = [_read_deviation(row, "turn deviation", math.radians(assumed[1]), TURN_RAD) for row in ordered]
    stated = all(row.text("deviation") and row.text("turn deviation") for row in ordered)
    observation = Observation(
        assembly=assembly,
        start=place_layout(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start,
        poses=np.array([_read_pose(row) for row in ordered]).reshape(-1, 4, 4),
        covariance=np.array([np.diag([s] * 3 + [t] * 3) ** 2 for s, t in zip(shift, turn, strict=True)]).reshape(
            -1, 6, 6
        ),
        observed=np.array([_read_flag(row) for row in ordered], dtype=np.bool_),
        gap_m=scenario.gap_mm * 1e-3,
        play_m=_read_play(ordered, scenario.clearance_mm * 1e-3),
    )
    return observation, not stated


def write_csv_table(assembly: Assembly, goals: Array) -> str:
    """Return target poses (n, 4, 4), [m], as a CSV table in mm, with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["operation", "part", *(f"{name}_mm" for name in _POSITION), *_QUATERNION])
    for k, (operation, T) in enumerate(zip(assembly.operations, goals, strict=True)):
        packed = pose.pack(T) * [1e3, 1e3, 1e3, 1, 1, 1, 1]
        writer.writerow([k + 1, operation.main, *map(repr, packed.tolist())])
    return text.getvalue()


def _read_operation(row: CsvRow, assembly: Assembly) -> int:
    """Return the operation of a row, counted from 0; check that its part is the one that the operation moves."""
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


def _read_pose(row: CsvRow) -> Array:
    """Return the pose of a row, (4, 4), [m]."""
    position = [row.number(name, FARTHEST_M) for name in _POSITION]
    units = {row.cells[name].unit for name in _POSITION}
    require(len(units) == 1, f"{row.file}: the columns of a position are of different units; give all in mm, or in m.")
    w, x, y, z = (row.number(name, 2.0) for name in _QUATERNION)
    q = check_quaternion((w, x, y, z), f"{row.file}, line {row.line}, columns qw to qz")
    return pose.unpack(np.array([*position, *q]))


def _read_deviation(row: CsvRow, meaning: str, assumed: float, limits: tuple[float, float]) -> float:
    """Return a standard deviation of a row, [m] or [rad]; the assumed one if the cell is empty.

    Args:
        limits: Least and greatest allowed value, [m] or [rad].
    """
    if not row.text(meaning):
        return assumed
    x = row.number(meaning, math.inf)
    low, high = (limit / row.cells[meaning].unit for limit in limits)
    row.require(is_within(x, limits), meaning, f"a standard deviation from {low:g} to {high:g} is needed")
    return x


def _read_play(rows: Sequence[CsvRow], assumed: float) -> float:
    """Return the clearance per side of parts that fit, [m]: the same number in all rows, or the assumed one."""
    stated = [(row, row.number("play", FARTHEST_M)) for row in rows if row.text("play")]
    for row, x in stated:
        row.require(x >= 0.0 and x == stated[0][1], "play", "one length from 0 for all rows is needed")
    return stated[0][1] if stated else assumed


def _read_flag(row: CsvRow) -> bool:
    """Return whether the operation of a row was observed; an empty cell means true."""
    text = row.text("seen").lower()
    row.require(text in _FLAGS, "seen", "true or false is needed")
    return _FLAGS[text]
