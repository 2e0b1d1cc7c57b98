"""Describe each operation of a plan by macros: how its part leaves its old contacts and comes into the new ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.assembly import Assembly, Contact, Poses, compute_placements
from apo_bench.geometry import Array
from apo_bench.planning.insertion.arrival import Arrival, plan_arrival
from apo_bench.planning.insertion.attach_line import ANY, Preference
from apo_bench.planning.insertion.contact_states import (
    ANGLE_RAD,
)


@final
@dataclass(frozen=True, eq=False)
class OperationMacros:
    """The macros of one operation, with the contact states before and after."""

    operation: int
    """Counted from 0."""
    main: str
    carries: tuple[str, ...]
    before: Arrival
    """Arrival of the part at the place that it leaves; its `departs` are executed."""
    after: Arrival
    """Arrival of the part at its goal."""

    @property
    def names(self) -> tuple[str, ...]:
        """The macros in their order of execution, such as `depart`, `move-to-contact`."""
        return tuple(macro.name for macro in (*self.before.departs, *self.after.macros))


def describe_operation_macros(
    assembly: Assembly,
    start: Poses,
    goals: Array,
    stated: Sequence[Preference] = (),
    angle_rad: float = ANGLE_RAD,
) -> tuple[OperationMacros, ...]:
    """The macros of every operation, in order.

    Args:
        start: Poses before the first operation, z upwards, [m].
        goals: (n, 4, 4), target poses of the main parts, in the same frame, [m].
        stated: Preferred lines of attach, one per operation, each in the frame of its main part. A direction that leads
            through a contact is ignored. Empty: none is stated.
        angle_rad: Faces within this angle are parallel; larger than rounding if the goals were observed.
    """
    stages = (start, *compute_placements(assembly, start, goals))
    lines = tuple(stated) or (ANY,) * len(assembly)
    understood: list[OperationMacros] = []
    put: dict[str, int] = {}  # main part -> its latest operation
    for k, operation in enumerate(assembly.operations):
        was = _find_blocking_operation(assembly, put.get(operation.main), operation.moves)
        # A part that was attached by an earlier operation leaves on the same line.
        back = ANY if was is None else understood[was].after.line.stated
        before = plan_arrival(assembly, operation.moves, _list_lost_contacts(assembly, k), stages[k], back, angle_rad)
        after = plan_arrival(assembly, operation.moves, operation.contacts, stages[k + 1], lines[k], angle_rad)
        understood.append(OperationMacros(k, operation.main, operation.carries, before, after))
        put[operation.main] = k
    return tuple(understood)


def _find_blocking_operation(assembly: Assembly, was: int | None, moved: tuple[str, ...]) -> int | None:
    """`was`, if the contacts of that operation hold the part back; None if it has none, or all of them move along.

    Args:
        was: Latest operation that placed the part; None if there was none.
        moved: The parts that move now.
    """
    if was is None or all(contact.environment.part in moved for contact in assembly.operations[was].contacts):
        return None
    return was


def _list_lost_contacts(assembly: Assembly, k: int) -> tuple[Contact, ...]:
    """The contacts that operation k breaks: undoing it makes them again."""
    return tuple(contact for contact, made, lost in assembly.relations() if lost == k and made < k)
