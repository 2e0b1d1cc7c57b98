"""Check the order of operations: carried parts are connected, moves change a pose, and no part is left in the air."""

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses
from apo_bench.errors import require
from apo_bench.geometry import TOUCH_M, measure_drop, measure_drop_depths

_SAME = 1e-9
"""Poses that differ by less in every component are equal."""


def check_order(assembly: Assembly, stages: tuple[Poses, ...], file: str) -> None:
    """Check carried parts and parts that are moved again.

    Args:
        stages: Poses of all parts before the first operation and after each one.
        file: Name of the file, for messages.

    Raises:
        InputError: The first fault that is found.
    """
    for k, operation in enumerate(assembly.operations):
        loose = _find_loose_carried_part(assembly, k)
        require(
            loose is None,
            f"{file}, operation {k + 1}, carries: '{loose}' is carried, but no contact that stands at that time "
            f"connects it with '{operation.main}', not even through another carried part; leave it out, or let an "
            "earlier operation make that contact.",
        )
        require(
            np.abs(stages[k + 1][operation.main] - stages[k][operation.main]).max() >= _SAME,
            f"{file}, operation {k + 1}, goal: '{operation.main}' stands there already; give another goal, or take "
            "this operation out.",
        )
        left = _find_part_without_contact(assembly, k)
        require(
            left is None,
            f"{file}, operation {k + 1}, carries: after it '{left}' rests on nothing that a contact names; "
            "carry it along, or move it first.",
        )


def _find_part_without_contact(assembly: Assembly, k: int) -> str | None:
    """The first part that was placed and has no contact left after operation k, counted from 0; None if none."""
    put = {part for operation in assembly.operations[: k + 1] for part in operation.moves}
    known = assembly.first(k + 1)
    held = {
        part
        for relation in known.relations()
        if relation.lost is None
        for part in _list_parts_of_contact(relation.contact)
    }
    return next((part for part in assembly.solids if part in put - held), None)


def _find_loose_carried_part(assembly: Assembly, k: int) -> str | None:
    """The first carried part of operation k that no chain of contacts connects with the main part; None if none."""
    operation = assembly.operations[k]
    standing = [
        _list_parts_of_contact(relation.contact) for relation in assembly.first(k).relations() if relation.lost is None
    ]
    together = {operation.main}
    for _ in operation.carries:
        together |= {part for ends in standing if ends & together for part in ends & {*operation.carries}}
    return next((part for part in operation.carries if part not in together), None)


def _list_parts_of_contact(contact: Contact) -> set[str]:
    """The two parts of a contact."""
    return {contact.manipulated.part, contact.environment.part}


LARGEST_START_GAP_M = 1e-4
"""A part that starts lower above its support settles within the first simulation steps."""


def find_floating_part(assembly: Assembly, start: Poses, most_m: float = LARGEST_START_GAP_M) -> tuple[str, str] | None:
    """Find the first movable part that starts more than `most_m` above its support.

    Returns:
        Name of the part, and the fault as a sentence; None if there is no such part.
    """
    for part, solid in assembly.solids.items():
        others = {name: other for name, other in assembly.solids.items() if name != part}
        way = np.array([most_m])
        deep = (measure_drop_depths(solid, start[part], way, other, start[name])[0] for name, other in others.items())
        if part not in assembly.fixed and not any(depth > TOUCH_M for depth in deep):
            falls = {name: measure_drop(solid, start[part], other, start[name]) for name, other in others.items()}
            below = min(falls, key=lambda name: falls[name])
            height = f"{round(1e3 * falls[below], 2):g} mm above '{below}'"
            return part, f"'{part}' starts in the air, {'with nothing below it' if np.isinf(falls[below]) else height}"
    return None
