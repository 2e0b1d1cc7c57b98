"""One operation as the hands do it, from the scenario."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.surroundings import OVER_M, ends_of, slide_directions
from apo_bench.scenario import (
    Scenario,
    list_nominal_operations,
)

_SIDE_M = 0.002
"""A part comes down this far beside one that it will lie against, and leaves it by as much before it is lifted."""


@final
@dataclass(frozen=True, eq=False)
class HandOperation:
    """One operation as the hands do it; poses and directions in the world, [m]."""

    part: str
    carries: tuple[str, ...]
    target: Array
    """(4, 4), of the part."""
    direction: Array
    """Unit vector of the last motion, (3,)."""
    travel: float
    out: Array
    """(3,), the first motion: away from what the part lies against or sticks in; zero: straight up."""
    aside: Array
    """(3,), how far beside its target it comes down; zero if it comes to lie against nothing."""
    true: Poses
    """Where every part should be when all is done."""
    bearing: tuple[str, ...]
    """The moved parts that make contacts."""
    over: float
    """How high the part must be lifted so that what moves passes over what stands, [m]."""
    drags: bool
    """Whether it comes level, over a floor to which it has no play."""
    late: tuple[str, ...]
    """Parts that are displaced and now brought to their true places by the other hand."""

    @property
    def from_above(self) -> bool:
        return bool(self.direction[2] < -0.5)


def plan_hand_operation(
    scenario: Scenario, k: int, target: Array, stages: tuple[Poses, ...], late: tuple[str, ...]
) -> HandOperation:
    """Operation k for the hands.

    Args:
        target: (4, 4), where the hands put the main part, right or wrong.
        stages: Where every part should be before the first operation and after each.
        late: Displaced parts that the other hand corrects.
    """
    assembly = scenario.assembly
    operation = assembly.operations[k]
    nominal = list_nominal_operations(scenario)[k]
    direction = target[:3, :3] @ nominal.after.line.direction
    on_floor = any(each.normal[2] > 0.5 and not assembly.play(each.contact, 1.0) for each in nominal.after.touched)
    top, bottom = ends_of(assembly, operation.moves, stages[k])
    beside = _off(slide_directions(assembly, nominal.after, stages[k + 1]))
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
        drags=abs(direction[2]) < 0.5 and on_floor,
        late=late,
    )


def _out(assembly: Assembly, before: Arrival, poses: Poses) -> Array:
    """The motion, (3,) [m], that frees what moves: back out of where it sticks, or off what is beside."""
    direction = poses[before.main][:3, :3] @ before.line.direction
    if before.touched and abs(direction[2]) < 0.5:
        return np.asarray(-before.line.travel_m * direction)
    return _SIDE_M * _off(slide_directions(assembly, before, poses))


def _off(sides: tuple[Array, ...]) -> Array:
    """Away from all of them, (3,); zero if there is none."""
    return -np.sum(np.array(sides).reshape(-1, 3), axis=0)
