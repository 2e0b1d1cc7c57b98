"""Rows as a report reads them: only the columns it shows, words kept once, so that 100,000 fit into memory."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from apo_bench.records.row import ROW_FIELDS, Predicted, Row
from apo_bench.records.run.run_folder import each_row

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
    "promised": "promised",
    "extra_operations": "extra operations",
    "peak_force_n": "peak force [N]",
    "sim_seconds": "simulated [s]",
}
"""Numbers of a row that the page shows, in its order, with what they are called there."""
_LEFT_OUT = (
    "env_id",
    "thresholds",
    "as_demonstrated_code",
    "conditions",
    "tried",
    "free_moved",
    "moved_in_hand",
    "reached",
)
"""Not kept of a row; it is read again where it is needed."""
COLUMNS = tuple(column for column in ROW_FIELDS if column not in _LEFT_OUT)
"""What is kept of a row."""


def report_rows(folder: str | Path) -> list[Row]:
    """The rows of a sweep with the `COLUMNS`; what a row does not say is None.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a whole row.
    """
    predictions: dict[Any, Predicted] = {}
    return [_kept(row, predictions) for row in each_row(folder)]


def _kept(row: Row, predictions: dict[Any, Predicted]) -> Row:
    kept: dict[str, Any] = {name: value for name, value in row.items() if name not in _LEFT_OUT}
    for name, value in kept.items():
        if type(value) is str:
            kept[name] = sys.intern(value)
    predicted = row["predicted"]
    if predicted is not None:
        what = (predicted["fails"], predicted["operation"], predicted["code"])
        known: Predicted = {"fails": predicted["fails"], "operation": predicted["operation"], "code": predicted["code"]}
        kept["predicted"] = predictions.setdefault(what, known)
    return cast(Row, kept)
