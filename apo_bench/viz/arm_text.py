"""The properties and check results of an arm, as one line and as one JSON object."""

from dataclasses import asdict
from typing import Any

import numpy as np

from apo_bench.simulation.arm_checks.arm_check import ArmCheck
from apo_bench.simulation.arms.arm import Arm


def describe_arm(arm: Arm) -> str:
    """Describe an arm: `6 joints, opens 85.6 mm, 44 N a pad, payload 5 kg; position servos made from the model`."""
    hand = f", {arm.hand.force_n:.0f} N a pad" if arm.hand is not None else ""
    payload = f", payload {arm.limits.payload_kg:g} kg" if arm.limits.payload_kg is not None else ""
    # opening_m is the opening of each finger
    return f"{len(arm.joints)} joints, opens {2e3 * arm.opening_m:.1f} mm{hand}{payload}; {arm.control}"


def arm_check_form(check: ArmCheck) -> dict[str, Any]:
    """Return everything that the check measured as a JSON object; `missing` lists what the arm lacks."""
    arm = check.arm
    reached = check.reached[:, 2] == 1.0  # places of the table that the arm reaches at every turn of the tip
    margins = (float(x) if np.isfinite(x) else "no limit" for x in check.margins_deg)
    return {
        "arm": describe_arm(arm),
        "home_deg": np.degrees(arm.home).tolist(),
        "base_mm": [1e3 * x for x in arm.base],
        "places_in_reach_at_every_turn": f"{reached.sum()} of {len(reached)}",
        "tip_errors": [asdict(error) for error in check.tip_errors],
        "rest_error_mm": check.rest_error_mm if check.tip_errors else None,
        "mm_per_n": list(check.mm_per_n) if check.tip_errors else None,
        "opening_mm": check.opening_mm,
        "force_of_each_pad_n": check.force_n,
        "margins_to_joint_limits_deg": dict(zip(arm.joints, margins, strict=True)) if check.layouts_reached else None,
        "layouts_in_reach": f"{check.layouts_reached} of {check.layouts} of {check.scenario}",
        "missing": list(check.missing) or "nothing",
    }
