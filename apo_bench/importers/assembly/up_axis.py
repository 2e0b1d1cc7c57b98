"""Choose the up axis and the base part of an assembly: as stated, or the first choice that works."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from apo_bench.errors import InputError
from apo_bench.importers.assembly.added_clearance import MOST_OVERLAP_MM, add_clearance
from apo_bench.importers.assembly.new_scenario import NewScenario, NoAssemblyOrder, find_lowest_part, new_scenario
from apo_bench.importers.assembly.posed_parts import PosedPart, place_on_table

_UP_AXES = ("z", "-z", "x", "-x", "y", "-y")  # in the order of the attempts
_MOST_BASES = 3  # of the lowest parts that are tried as base


def new_upright_scenario(
    parts: Sequence[PosedPart],
    up: str | None = None,
    fixed: Sequence[str] = (),
    clearance_mm: float = 0.25,
    most_overlap_mm: float = MOST_OVERLAP_MM,
    wanted_order: Sequence[str] = (),
) -> NewScenario:
    """Make a scenario from an assembly with one axis of its poses up.

    Args:
        up: A key of `posed.UPS`; None: z, or the axis with the fewest parts that cannot be grasped.
        clearance_mm: Clearance per side of faces that fit.
        most_overlap_mm: Parts without play get clearance if they overlap by no more than this; 0: none does.
        wanted_order: The moved parts in the wanted order; empty: any order.

    Raises:
        InputError: No part has that name, or there is no room on the table.
        RuntimeError: Parts are inside each other, or there is no order in which they can be put together.
    """
    parts, notes = add_clearance(parts, clearance_mm, most_overlap_mm)
    found: dict[str, NewScenario] = {}
    failed: dict[str, NoAssemblyOrder | InputError] = {}
    for axis in (up,) if up else _UP_AXES:
        try:
            scenario = _try_bases(place_on_table(parts, axis), fixed, clearance_mm, wanted_order)
        except (NoAssemblyOrder, InputError) as error:
            failed[axis] = error
            continue
        found[axis] = replace(scenario, notes=(*notes, *scenario.notes))
        if not scenario.unfit:  # all parts can be grasped, so no other axis is tried
            break
    if not found:
        raise next(iter(failed.values()))  # that of the first axis
    best = min(found, key=lambda axis: len(found[axis].unfit))
    if up or best == "z":
        return replace(found[best], up=f"{best}, as asked" if up else best)
    why = str(failed["z"]).rstrip(".") if "z" in failed else "; ".join(found["z"].unfit)
    return replace(found[best], up=f"{best}, as with z up {why}")


def _try_bases(
    parts: Sequence[PosedPart], fixed: Sequence[str], clearance_mm: float, wanted_order: Sequence[str]
) -> NewScenario:
    """Make the scenario on the fixed parts, or on the largest of the lowest parts for which an order exists."""
    try:
        return new_scenario(parts, fixed, clearance_mm, wanted_order)
    except NoAssemblyOrder:
        for base in () if fixed else find_lowest_part(parts)[1:_MOST_BASES]:
            with suppress(NoAssemblyOrder):
                scenario = new_scenario(parts, (base,), clearance_mm, wanted_order)
                return replace(scenario, why_fixed="one of the lowest; with larger ones there is no order")
        raise
