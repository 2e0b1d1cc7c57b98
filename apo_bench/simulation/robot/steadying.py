"""What is carried freely stays where it is in the hand.

A contact of MuJoCo asks for J a = -b J v, where J v is the speed of one side past the other. The acceleration of one
side past the other is J a + dJ/dt v, and dJ/dt v is not zero where contacts move along an arc. So the pads take a
carried part along with an error of some |dJ/dt v| / b, 1 mm/s: it creeps by 0.1 to 1.1 mm until it is above its goal.
With dJ/dt v taken off the right side, step by step, 0.77 mm became 0.03 at best and 0.41 became 0.18 at worst; that
would cost more than it is worth here.
Friction, the force and stiffness of the fingers and the softness of friction change it by at most 0.04 mm. Half the
speed halves it; so does half the time constant of the pads, with which parts that are off slip in.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.simulation.scene.world import World, part_pose, place, touch_others

SLIPS_M = 5e-5
"""What moves farther in the hand in a tick does not creep: it slips."""


class Carried(NamedTuple):
    """What is in the hand on a way through the air."""

    parts: tuple[str, ...]
    """The part that the fingers hold, then those that it carries."""
    T_tip_part: Array | None = None
    """Where the first part is kept in the hand, (4, 4); None while it is not carried freely."""


def steadied(world: World, data: Any, T_world_tip: Array, carried: Carried) -> Carried:
    """Put what is carried back where it was in the hand a tick ago, as one rigid body.

    Nothing is put back while any of it touches anything but the hand, and what slips in earnest is left to slip.
    """
    if touch_others(world, data, carried.parts):
        return carried._replace(T_tip_part=None)
    now = part_pose(world, data, carried.parts[0])
    if carried.T_tip_part is not None:
        wanted = T_world_tip @ carried.T_tip_part
        if np.linalg.norm((wanted - now)[:3, 3]) <= SLIPS_M:
            _shift(world, data, carried.parts, wanted @ pose.inverse(now))
            return carried
    return carried._replace(T_tip_part=pose.inverse(T_world_tip) @ now)


def _shift(world: World, data: Any, parts: tuple[str, ...], by: Array) -> None:
    """Move parts by a little, (4, 4), world; their speeds stay."""
    for part in parts:
        v = world.dof[part]
        speed = np.array(data.qvel[v : v + 6])
        place(world, data, part, by @ part_pose(world, data, part))
        data.qvel[v : v + 6] = speed
