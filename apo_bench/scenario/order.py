"""Checks that operations follow from each other."""

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses
from apo_bench.errors import require
from apo_bench.geometry import TOUCH_M, measure_drop, measure_drop_depths

_SAME = 1e-9
"""Poses that differ by less, [m] and unitless, are one and the same."""


def check_order(assembly: Assembly, stages: tuple[Poses, ...], file: str) -> None:
    """Check what is carried and what is moved again.

    Args:
        stages: Where every part stands before the first operation and after each.

    Raises:
        InputError: The first thing found wrong.
    """
    for k, operation in enumerate(assembly.operations):
        loose = _loose(assembly, k)
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
        left = _left_in_the_air(assembly, k)
        require(
            left is None,
            f"{file}, operation {k + 1}, carries: after it '{left}' rests on nothing that a contact names; "
            "carry it along, or move it first.",
        )


def _left_in_the_air(assembly: Assembly, k: int) -> str | None:
    """A part that was put down before and, after operation k, has no contact left."""
    put = {part for operation in assembly.operations[: k + 1] for part in operation.moves}
    known = assembly.first(k + 1)
    held = {part for relation in known.relations() if relation.lost is None for part in _ends(relation.contact)}
    return next((part for part in assembly.solids if part in put - held), None)


def _loose(assembly: Assembly, k: int) -> str | None:
    """A part that operation k carries and that does not hang together with its main part."""
    operation = assembly.operations[k]
    standing = [_ends(relation.contact) for relation in assembly.first(k).relations() if relation.lost is None]
    together = {operation.main}
    for _ in operation.carries:
        together |= {part for ends in standing if ends & together for part in ends & {*operation.carries}}
    return next((part for part in operation.carries if part not in together), None)


def _ends(contact: Contact) -> set[str]:
    return {contact.manipulated.part, contact.environment.part}


AIR_M = 1e-4
"""Lower above what is below it, a part settles within the first steps, at its start."""


def find_part_in_the_air(assembly: Assembly, start: Poses, most_m: float = AIR_M) -> tuple[str, str] | None:
    """The first movable part that starts more than so much above what is below it, and where it is, in words."""
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
