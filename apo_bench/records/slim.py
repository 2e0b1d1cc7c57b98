"""Rows as a report reads them: only the columns it shows, words kept once, so that 100,000 fit into memory."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from apo_bench.records.run_folder import each_row

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
Row = dict[str, Any]


def slim_rows(folder: str | Path) -> list[Row]:
    """The rows of a sweep with the `COLUMNS`; what a row does not say is None.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a whole row.
    """
    foretold: dict[Any, Any] = {}
    return [_slim(row, foretold) for row in each_row(folder)]


def _slim(row: Mapping[str, Any], foretold: dict[Any, Any]) -> Row:
    kept = {name: row[name] for name in COLUMNS}
    for name, value in kept.items():
        if type(value) is str:
            kept[name] = sys.intern(value)
    said = kept["predicted"]
    if said is not None:
        what = (said["fails"], said["operation"], said["code"])
        kept["predicted"] = foretold.setdefault(what, dict(zip(("fails", "operation", "code"), what, strict=True)))
    return kept
