"""Clamps: welds that fix a part to another one where it was placed, in place of screws that no operation drives."""

from typing import Any

from apo_bench.geometry import Array, pose
from apo_bench.scenario import Scenario
from apo_bench.simulation.frames import body_frame, quaternion
from apo_bench.simulation.scene.world import CLAMP, World


def list_clamps(scenario: Scenario) -> dict[str, str]:
    """Return each part that an operation clamps -> the part to which it is clamped."""
    clamped = [operation for operation in scenario.assembly.operations if operation.clamped]
    return {each.main: each.contacts[0].environment.part for each in clamped}


def weld_clamp(world: World, data: Any, part: str, other: str, T_world_part: Array | None = None) -> None:
    """Fix a part to another one.

    Args:
        T_world_part: Pose to which the part is drawn, (4, 4); None: its present pose.
    """
    model = world.model
    weld = model.equality(f"{CLAMP}{part}").id
    at = body_frame(data, world.body[part]) if T_world_part is None else T_world_part
    T = pose.inverse(body_frame(data, world.body[other])) @ at
    # MuJoCo's data of a weld: anchor (3), relative position (3), quaternion (4), torque scale (1).
    model.eq_data[weld, :11] = (0, 0, 0, *T[:3, 3], *quaternion(T), 1)
    data.eq_active[weld] = 1


def release_clamp(world: World, data: Any, part: str) -> None:
    """Release the clamp of a part, if it has one."""
    for weld in world.clamps:
        if world.model.equality(weld).name == f"{CLAMP}{part}":
            data.eq_active[weld] = 0
