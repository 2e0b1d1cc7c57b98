"""The macros of the plan as motions in the world, for a part that is believed to be somewhere."""

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.insertion.arrival import Arrival
from apo_bench.insertion.line import Attach
from apo_bench.simulation.execution.transfer import ApproachLine, Motion

PUT_DOWN = Attach(np.array([0.0, 0.0, -1.0]), 0.05)
"""How a part that was taken off is put down, in the world."""


def arrival_line(found: Arrival, T: Array) -> ApproachLine:
    """The line on which a part arrives at T; straight down if it touches nothing there that is known of."""
    if not found.touched:
        return ApproachLine(PUT_DOWN.direction, PUT_DOWN.travel_m)
    return ApproachLine(T[:3, :3] @ found.line.direction, found.line.travel_m)


def motions(found: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """The macros in the world, for a part that arrives at T; slides as they are believed to be."""
    straight = [macro for macro in found.macros if macro.name != "slide-to-contact"]
    made = [Motion(macro.name, T[:3, :3] @ found.own(macro.direction)) for macro in straight]
    return (*made, *(Motion("slide-to-contact", side) for side in sides))


def departure_motions(found: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """The macros backwards, for a part that leaves T: off its sides, the last first, then out of what encloses it."""
    out = [macro for macro in found.departs if macro.length_m is not None]
    drawn = [Motion(macro.name, T[:3, :3] @ found.own(macro.direction)) for macro in out]
    return (*(Motion("depart", -side) for side in reversed(sides)), *drawn)
