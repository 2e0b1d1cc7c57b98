"""Plan one operation for the hands of the human, from the scenario."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.insertion_geometry import OVER_M, list_slide_directions, measure_clearing_heights
from apo_bench.scenario import (
    Scenario,
    list_nominal_operations,
)
from apo_bench.simulation.scene import list_clamps

_SIDE_M = 0.002
"""Distance to the sides of a part while it is lowered before a slide, or lifted after one."""


@final
@dataclass(frozen=True, eq=False)
class HandOperation:
    """One operation for the hands; poses and directions in the world frame, [m]."""

    part: str
    carries: tuple[str, ...]
    target: Array
    """(4, 4): goal of the part, with the human error."""
    direction: Array
    """Unit vector of the last motion, (3,)."""
    travel: float
    """Length of the last motion."""
    out: Array
    """(3,), the first motion, out of walls or off sides; zero: the part is lifted at once."""
    aside: Array
    """(3,), offset from the target at which the part is lowered; zero if no slide follows."""
    true: Poses
    """True poses of all parts after the operation."""
    bearing: tuple[str, ...]
    """The moved parts that make contacts."""
    over: float
    """Height of the part's frame at which the moved parts pass over all others, [m]."""
    drags: bool
    """Whether the part is inserted level, over a floor without play."""
    late: tuple[str, ...]
    """Displaced parts that the other hand now moves to their true poses."""
    clamps_to: str
    """The part to which the part is clamped before it is released; empty if it is not clamped."""

    @property
    def from_above(self) -> bool:
        return bool(self.direction[2] < -0.5)


def plan_hand_operation(
    scenario: Scenario, k: int, target: Array, stages: tuple[Poses, ...], late: tuple[str, ...]
) -> HandOperation:
    """Plan operation k for the hands.

    Args:
        target: (4, 4), goal of the main part, with the human error.
        stages: True poses of all parts before the first operation and after each.
        late: Displaced parts that the other hand corrects.
    """
    assembly = scenario.assembly
    operation = assembly.operations[k]
    nominal = list_nominal_operations(scenario)[k]
    direction = target[:3, :3] @ nominal.after.line.direction
    on_floor = any(each.normal[2] > 0.5 and not assembly.play(each.contact, 1.0) for each in nominal.after.touched)
    top, bottom = measure_clearing_heights(assembly, operation.moves, stages[k])
    beside = _off(list_slide_directions(assembly, nominal.after, stages[k + 1]))
    return HandOperation(
        part=operation.main,
        carries=operation.carries,
        target=target,
        direction=direction,
        travel=nominal.after.line.travel_m,
        out=_out(assembly, nominal.before, stages[k]),
        aside=_SIDE_M * beside if direction[2] < -0.5 else np.zeros(3),
        true=stages[k + 1],
        bearing=tuple(dict.fromkeys(contact.manipulated.part for contact in operation.contacts)),
        over=top + (float(stages[k][operation.main][2, 3]) - bottom) + OVER_M,
        drags=abs(direction[2]) < 0.5 and on_floor and not operation.clamped,
        late=late,
        clamps_to=list_clamps(scenario).get(operation.main, "") if operation.clamped else "",
    )


def _out(assembly: Assembly, before: Arrival, poses: Poses) -> Array:
    """The first motion, (3,), [m], that frees the moved parts: back out of a level insertion, or off the sides."""
    direction = poses[before.main][:3, :3] @ before.line.direction
    if before.touched and abs(direction[2]) < 0.5:
        return np.asarray(-before.line.travel_m * direction)
    return _SIDE_M * _off(list_slide_directions(assembly, before, poses))


def _off(sides: tuple[Array, ...]) -> Array:
    """The sum of the opposite directions of `sides`, (3,); zero if there are none."""
    return -np.sum(np.array(sides).reshape(-1, 3), axis=0)
