"""Rows as a report reads them: only the columns it shows, words kept once, so that 100,000 fit into memory."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from apo_bench.benchmark.journal import each_row
from apo_bench.benchmark.spec import RANGE
from apo_bench.errors import InputError

NUMBERS: Mapping[str, str] = {
    "gap_before_mm": "gap as seen [mm]",
    "gap_after_mm": "gap as planned [mm]",
    "worst_gap_mm": "gap reached [mm]",
    "worst_angle_deg": "angle reached [deg]",
    "least_overlap": "least overlap",
    "penetration_mm": "penetration [mm]",
    "pushed_mm": "pushed [mm]",
    "planned_error_fixed_mm": "planned error, fixed [mm]",
    "planned_error_free_mm": "planned error, free [mm]",
    "pose_error_fixed_mm": "reached error, fixed [mm]",
    "pose_error_free_mm": "reached error, free [mm]",
    "p_value": "p of the test",
    "extra_operations": "extra operations",
    "peak_force_n": "peak force [N]",
    "sim_seconds": "simulated [s]",
}
"""Numbers of a row that the page shows, in its order, with what they are called there."""
SAID = (
    *("schema", "spec_hash", "scenario", "level", "level_deg", "careless", "clearance_mm", "eye", "noise", "grasp"),
    *("arm", "relations", "method", "seed", "salt", "timestep_s", "fidelity", "demonstration"),
    *("success", "as_demonstrated", "loose_success", "failure_stage", "failure_code", "failure_operation"),
    *("sentence", "freed", "predicted"),
)
TESTED = (
    *("chi_square", "chi_square_freedom", "test_passes", "suspects", "dropped", "wrong_relation", "inside_95"),
    *("contacts_right", "contacts_missed", "contacts_false"),
)
COLUMNS = (*SAID, *TESTED, *NUMBERS)
"""What is kept of a row; the rest (thresholds, conditions, final poses, attempts) is read again where it is needed."""
NEEDED = ("demonstration", "success", "as_demonstrated", "loose_success", "failure_stage", "failure_code")
"""What every row says, besides its key."""
USUAL = {"fidelity": "full", "arm": "six_axis", "timestep_s": 0.001}
"""What a row that does not say means."""

Row = dict[str, Any]


def slim_rows(folder: str | Path) -> list[Row]:
    """The rows of a sweep with the `COLUMNS`; what a row does not say is None.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a whole row.
    """
    foretold: dict[Any, Any] = {}
    return [_slim(row, foretold, folder) for row in each_row(folder)]


def _slim(row: Mapping[str, Any], foretold: dict[Any, Any], folder: str | Path) -> Row:
    for name in NEEDED:
        if name not in row:
            raise _wrong(row, folder, f"without '{name}'")
    for name in ("success", "as_demonstrated", "loose_success"):
        if row[name] is not None and type(row[name]) is not bool:
            raise _wrong(row, folder, f"whose '{name}' is neither true, false nor null ({row[name]!r})")
    for name in NUMBERS:
        x = row.get(name)
        if x is not None and (type(x) not in (int, float) or not math.isfinite(x)):
            raise _wrong(row, folder, f"whose '{name}' is no number ({x!r})")
    kept = {name: row.get(name) for name in COLUMNS}
    for name, value in kept.items():
        if type(value) is str:
            kept[name] = sys.intern(value)
    kept["eye"] = kept["eye"] or (RANGE if kept["noise"] == RANGE else "noise")
    said = kept["predicted"]
    if said is not None:
        what = (said["fails"], said["operation"], said["code"])
        kept["predicted"] = foretold.setdefault(what, dict(zip(("fails", "operation", "code"), what, strict=True)))
    return {**USUAL, **{name: value for name, value in kept.items() if value is not None or name not in USUAL}}


def _wrong(row: Mapping[str, Any], folder: str | Path, what: str) -> InputError:
    which = f"{row['scenario']}, {row['method']}, seed {row['seed']}"
    return InputError(
        f"'{folder}' holds a row {what} ({which}), so it is not as `apo-bench sweep` wrote it; remove the row or the "
        "folder."
    )
