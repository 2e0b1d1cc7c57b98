"""Reject parts that the gripper cannot hold (too wide, too heavy, too smooth) before the robot moves."""

from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import all_boxes, measure_held_span
from apo_bench.scenario import Scenario
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.scene.geoms import SMOOTH_PRIORITY
from apo_bench.simulation.scene.world import World

_GRAVITY = 9.81
_SAFE = 2.0
"""Factor of safety of the friction over the weight, for inertia and lever of a carried part."""
_BESIDE_M = 0.002
"""Gap between the part and each open finger."""


def check_holdable(scenario: Scenario, world: World, arm: Arm) -> None:
    """Raise an `InputError` if a part is too wide for the open gripper, too heavy or too smooth.

    A grasp with nothing between the pads is an error, too, unless the part is of boxes alone: then the replay loses it.
    """
    for k, (operation, grasp) in enumerate(zip(scenario.assembly.operations, scenario.grasps, strict=True)):
        solid = scenario.assembly.solids[operation.main]
        # Opposite of the direction of approach, part frame.
        up = scenario.start[operation.main][2, :3] if grasp.ahead is None else -grasp.ahead
        which = f"operation {k + 1}: the grasp of '{operation.main}'"
        span = measure_held_span(solid.pieces, grasp.point, grasp.across, np.round(up, 9))
        if span is None and not all_boxes(solid.pieces):
            at = ", ".join(f"{1e3 * x:g}" for x in grasp.point)
            raise InputError(
                f"{which} at ({at}) mm has nothing between the pads; give a point of the part, or leave 'grasp' out."
            )
        if span is not None and (span[1] - span[0]) / 2 + _BESIDE_M > arm.opening_m:
            raise InputError(
                f"{which} spans {1e3 * (span[1] - span[0]):g} mm; the gripper opens to {2e3 * arm.opening_m:g} mm, so "
                "hold the part elsewhere, across another way, or make it narrower."
            )
        weight = _GRAVITY * sum(float(world.model.body_subtreemass[world.body[part]]) for part in operation.moves)
        payload = arm.limits.payload_kg
        if payload is not None and weight > _GRAVITY * payload:
            raise InputError(
                f"operation {k + 1} lifts {weight / _GRAVITY:.3g} kg; the payload of the arm is {payload:g} kg, so "
                f"make '{operation.main}' smaller or less dense, or take another arm."
            )
        force, pads = _grip(world.model, arm)
        own = _smooth_friction(world, operation.main)
        most = force * (pads if own is None else own) / _SAFE
        if weight > most:
            lifts = f"operation {k + 1} lifts {weight / _GRAVITY:.3g} kg"
            holds = f"{most / _GRAVITY:.3g} kg"
            if own is not None and weight <= force * pads / _SAFE:
                raise InputError(
                    f"{lifts} by '{operation.main}', which is too smooth: with its friction of {own:g} the gripper "
                    f"holds {holds} with twofold safety, so make it rougher or lighter, or take the grasp 'weld'."
                )
            raise InputError(
                f"{lifts}; the friction of the pads holds {holds} with twofold safety, so make '{operation.main}' "
                "smaller or less dense, or take the grasp 'weld'."
            )


def _grip(model: Any, arm: Arm) -> tuple[float, float]:
    """(force of both pads together, [N], infinite if not limited; coefficient of friction of the pads)."""
    if arm.hand is not None:
        return 2 * arm.hand.force_n, arm.hand.friction
    force = float(model.actuator(f"arm/{arm.grip}").forcerange[1])
    fingers = {int(model.jnt_bodyid[model.joint(f"arm/{finger}").id]) for finger in arm.fingers}
    pads = [float(model.geom_friction[g, 0]) for g in range(model.ngeom) if int(model.geom_bodyid[g]) in fingers]
    return force if force > 0.0 else float("inf"), max(pads)


def _smooth_friction(world: World, part: str) -> float | None:
    """The friction of a smooth part, which counts instead of the pads'; None if the part is not smooth."""
    model = world.model
    root = model.body_rootid[world.body[part]]
    geoms = np.flatnonzero((model.body_rootid[model.geom_bodyid] == root) & (model.geom_priority == SMOOTH_PRIORITY))
    return float(model.geom_friction[geoms, 0].min()) if len(geoms) else None
