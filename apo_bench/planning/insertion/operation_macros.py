"""Operations in terms of macros: the contact states before and after each, and the macros between them.

States and macros are those of the nominal poses; a plan with other motion parameters has the same macros in the same
directions of its parts, so that a minor change is made by replacing one part of the plan.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.assembly import Assembly, Contact, Poses, compute_placements
from apo_bench.geometry import Array
from apo_bench.planning.insertion.arrival import Arrival, arrive
from apo_bench.planning.insertion.attach import ANY, Preference
from apo_bench.planning.insertion.states import (
    ANGLE_RAD,
)


@final
@dataclass(frozen=True, eq=False)
class OperationMacros:
    """One operation, in terms of macros."""

    operation: int
    """Counted from 0."""
    main: str
    carries: tuple[str, ...]
    before: Arrival
    """How the part would come to where it is taken from: undoing the operation does that."""
    after: Arrival
    """How it comes to its goal."""

    @property
    def names(self) -> tuple[str, ...]:
        """The macros in their order, such as `depart`, `move-to-contact`."""
        return tuple(macro.name for macro in (*self.before.departs, *self.after.macros))


def understand(
    assembly: Assembly,
    start: Poses,
    goals: Array,
    stated: Sequence[Preference] = (),
    angle_rad: float = ANGLE_RAD,
) -> tuple[OperationMacros, ...]:
    """Every operation.

    Args:
        start: Poses before the first operation, z upwards, [m].
        goals: (n, 4, 4), in the same frame, [m].
        stated: Lines of attach to be preferred, each in the frame of its main part; one that leads through a contact
            is not.
        angle_rad: Faces this near to parallel are; more than rounding where goals were only seen.
    """
    stages = (start, *compute_placements(assembly, start, goals))
    lines = tuple(stated) or (ANY,) * len(assembly)
    understood: list[OperationMacros] = []
    put: dict[str, int] = {}
    for k, operation in enumerate(assembly.operations):
        was = _held_by(assembly, put.get(operation.main), operation.moves)
        back = ANY if was is None else understood[was].after.line.stated
        before = arrive(assembly, operation.moves, _lost_at(assembly, k), stages[k], back, angle_rad)
        after = arrive(assembly, operation.moves, operation.contacts, stages[k + 1], lines[k], angle_rad)
        understood.append(OperationMacros(k, operation.main, operation.carries, before, after))
        put[operation.main] = k
    return tuple(understood)


def _held_by(assembly: Assembly, was: int | None, moved: tuple[str, ...]) -> int | None:
    """The operation `was`, out of whose contacts a part must be brought; None if all of them move along."""
    if was is None or all(contact.environment.part in moved for contact in assembly.operations[was].contacts):
        return None
    return was


def _lost_at(assembly: Assembly, k: int) -> tuple[Contact, ...]:
    """The contacts that operation k breaks: undoing it makes them again."""
    return tuple(contact for contact, made, lost in assembly.relations() if lost == k and made < k)
