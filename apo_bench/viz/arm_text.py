"""What an arm can do, in lines."""

import numpy as np

from apo_bench.simulation.arm_checks.arm_check import ArmCheck
from apo_bench.simulation.arms.arm import Arm


def list_line(name: str, arm: Arm) -> str:
    """`ur5e_primitive   6 joints, opens 85.6 mm, 44 N a pad, payload 5 kg; position servos made from the model`."""
    hand = f", {arm.hand.force_n:.0f} N a pad" if arm.hand is not None else ""
    payload = f", payload {arm.limits.payload_kg:g} kg" if arm.limits.payload_kg is not None else ""
    return f"{name}: {len(arm.joints)} joints, opens {2e3 * arm.opening_m:.1f} mm{hand}{payload}; {arm.control}"


def check_lines(check: ArmCheck) -> list[str]:
    """All that was found, one line each; at last what is missing."""
    arm = check.arm
    at = check.reached
    x, y, z = check.mm_per_n
    friction = f", friction {arm.hand.friction:g}, closes in {arm.hand.seconds:.2f} s" if arm.hand is not None else ""
    rooms = [f"{x:.0f}" if np.isfinite(x) else "no limit" for x in check.margins_deg]
    margins = ", ".join(f"{name} {room}" for name, room in zip(arm.joints, rooms, strict=True))
    return [
        f"joints: {len(arm.joints)} ({', '.join(arm.joints)}), {arm.control}",
        f"home: {_row(np.degrees(arm.home))} degrees; base at {_row(1e3 * np.array(arm.base))} mm",
        f"reach: {(at[:, 2] == 1.0).sum()} of {len(at)} places of the table, {100 * at[0, 0]:.0f} to "
        f"{100 * at[-1, 0]:.0f} cm ahead and {100 * at[0, 1]:.0f} to {100 * at[-1, 1]:.0f} cm aside of its middle, at "
        "every turn of the gripper",
        *(
            f"tip at {1e3 * error.speed:g} mm/s: {error.across_mm:.3f} mm beside its line, {error.along_mm:.3f} mm "
            f"behind, turned by {error.turn_deg:.3f} degrees at most"
            for error in check.tip_errors
        ),
        *(
            [
                f"tip at rest: {check.rest_error_mm:.4f} mm off",
                f"stiffness: a newton pushes the tip by {x:.4f} mm along x, {y:.4f} along y, {z:.4f} along z",
            ]
            if check.tip_errors
            else []
        ),
        f"gripper: opens {check.opening_mm:.1f} mm, each pad pushes with {check.force_n:.1f} N{friction}",
        *(
            [f"room to the limits of joints along the plans of {check.scenario}, degrees: {margins}"]
            if check.layouts_reached
            else []
        ),
        f"layouts of {check.scenario} in reach: {check.layouts_reached} of {check.layouts}",
        *([f"missing: {each}" for each in check.missing] or ["nothing is missing"]),
    ]


def _row(numbers: np.ndarray) -> str:
    return f"({', '.join(f'{x + 0.0:.1f}' for x in numbers)})"
