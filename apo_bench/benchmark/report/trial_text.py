"""Words and numbers that a page shows of a trial."""

from collections.abc import Mapping
from typing import Any

NUMBERS: Mapping[str, str] = {
    "gap_before_mm": "gap observed [mm]",
    "gap_after_mm": "gap planned [mm]",
    "worst_gap_mm": "gap reached [mm]",
    "worst_angle_deg": "angle reached [deg]",
    "least_overlap": "least overlap",
    "penetration_mm": "penetration [mm]",
    "placed_part_shift_mm": "pushed [mm]",
    "planned_error_fixed_mm": "planned error, fixed [mm]",
    "planned_error_free_mm": "planned error, free [mm]",
    "pose_error_fixed_mm": "reached error, fixed [mm]",
    "pose_error_free_mm": "reached error, free [mm]",
    "p_value": "p of the test",
    "predicted_success": "predicted success",
    "extra_steps": "extra steps",
    "peak_force_n": "peak force [N]",
    "sim_time_s": "simulated [s]",
}
"""Column of a record -> its name on a page, in the order of the page."""


def describe_verdict(row: Mapping[str, Any]) -> str:
    """Return the verdict on a trial in a few words."""
    if row["success"] is None:
        return "excluded"
    if row["success"]:
        return "right" if row["as_demonstrated"] else "right, not as demonstrated"
    return "loosely right" if row["loose_success"] else "failed"


def describe_failure(row: Mapping[str, Any]) -> str:
    """Return stage, code and operation of a failure: `attach: force_stop, operation 3`; empty without a failure."""
    if row["failure_stage"] is None:
        return ""
    where = "" if row["failure_operation"] is None else f", operation {row['failure_operation']}"
    return f"{row['failure_stage']}: {row['failure_code']}{where}"


def describe_prediction(row: Mapping[str, Any]) -> str:
    """Return the failure prediction of a plan in words; empty without a plan."""
    if row["predicted_fails"] is None:
        return ""
    return (
        f"operation {row['predicted_operation']} fails: {row['predicted_code']}" if row["predicted_fails"] else "fits"
    )
