"""What an arm can do, as lines."""

from collections.abc import Iterator

import numpy as np

from apo_bench.simulation.arm_checks.arm_check import ArmCheck
from apo_bench.simulation.arms.arm import Arm


def describe_arm(arm: Arm) -> str:
    """`6 joints, opens 85.6 mm, 44 N a pad, payload 5 kg; position servos made from the model`."""
    hand = f", {arm.hand.force_n:.0f} N a pad" if arm.hand is not None else ""
    payload = f", payload {arm.limits.payload_kg:g} kg" if arm.limits.payload_kg is not None else ""
    return f"{len(arm.joints)} joints, opens {2e3 * arm.opening_m:.1f} mm{hand}{payload}; {arm.control}"


def check_lines(check: ArmCheck) -> Iterator[tuple[str, str]]:
    """Name and text of everything that was measured; last what is missing."""
    arm = check.arm
    at = check.reached
    (near, right), (far, left) = 100.0 * at[0, :2], 100.0 * at[-1, :2]
    yield "joints", f"{len(arm.joints)} ({', '.join(arm.joints)}), {arm.control}"
    yield "home", f"{_list_numbers(np.degrees(arm.home))} degrees; base at {_list_numbers(1e3 * np.array(arm.base))} mm"
    yield (
        "reach",
        f"{(at[:, 2] == 1.0).sum()} of {len(at)} places of the table at every turn of the gripper, {near:.0f} to "
        f"{far:.0f} cm ahead and {right:.0f} to {left:.0f} cm aside of its middle",
    )
    for error in check.tip_errors:
        yield (
            f"tip at {1e3 * error.speed:g} mm/s",
            f"{error.across_mm:.3f} mm across its line, {error.along_mm:.3f} mm behind, "
            f"{error.turn_deg:.3f} degrees at most",
        )
    if check.tip_errors:
        x, y, z = check.mm_per_n
        yield "tip at rest", f"{check.rest_error_mm:.4f} mm off"
        yield "compliance", f"{x:.4f}, {y:.4f}, {z:.4f} mm per N along x, y, z"
    friction = f", friction {arm.hand.friction:g}, closes in {arm.hand.seconds:.2f} s" if arm.hand is not None else ""
    yield "gripper", f"opens {check.opening_mm:.1f} mm, each pad pushes with {check.force_n:.1f} N{friction}"
    if check.layouts_reached:
        margins = [f"{x:.0f}" if np.isfinite(x) else "no limit" for x in check.margins_deg]
        rooms = ", ".join(map(" ".join, zip(arm.joints, margins, strict=True)))
        yield "joint margins", f"{rooms} degrees along the plans of {check.scenario}"
    yield "layouts in reach", f"{check.layouts_reached} of {check.layouts} of {check.scenario}"
    yield "missing", "; ".join(check.missing) or "nothing"


def _list_numbers(numbers: np.ndarray) -> str:
    return f"({', '.join(f'{x + 0.0:.1f}' for x in numbers)})"
