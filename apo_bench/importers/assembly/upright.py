"""Which way up an assembly is put together, and on which of its parts: as asked, or the first way that works best."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from apo_bench.errors import InputError
from apo_bench.importers.assembly.draft import Draft, NoOrder, draft, lowest
from apo_bench.importers.assembly.loosening import LOOSEN_MM, filled, loosened
from apo_bench.importers.assembly.posed import PosedPart, on_the_table

USUAL_MM = 0.25
_FIRST = ("z", "-z", "x", "-x", "y", "-y")
_MOST_BASES = 3


def drafted(
    parts: Sequence[PosedPart],
    up: str | None = None,
    fixed: Sequence[str] = (),
    clearance_mm: float | None = None,
    loosen_mm: float = LOOSEN_MM,
    asked: Sequence[str] = (),
) -> Draft:
    """The draft of an assembly, with an axis of its poses up.

    Args:
        up: An axis of `posed.UPS`; None: z, unless parts then find no order, do not stand, or cannot be held, and
            another axis is better.
        clearance_mm: Room per side of faces that fit; None: as some parts were drawn, else `USUAL_MM`.
        loosen_mm: Parts without play are given some where they are no deeper in each other; 0: none are.
        asked: The parts that are moved, in the order in which they are put; none: any order.

    Raises:
        InputError: No part has that name, or there is no room on the table.
        RuntimeError: Parts are inside each other, or there is no order in which they can be put together.
    """
    parts, drawn_mm, said = filled(parts) if clearance_mm is None else (parts, None, ())
    clearance_mm = next(mm for mm in (clearance_mm, drawn_mm, USUAL_MM) if mm is not None)
    parts, more = loosened(parts, clearance_mm, loosen_mm)
    tried: dict[str, Draft] = {}
    failed: dict[str, NoOrder | InputError] = {}
    for axis in (up,) if up else _FIRST:
        try:
            made = _on_a_base(on_the_table(parts, axis), fixed, clearance_mm, asked)
        except (NoOrder, InputError) as error:
            failed[axis] = error
            continue
        tried[axis] = replace(made, notes=(*said, *more, *made.notes))
        if not made.unfit:
            break
    if not tried:
        raise next(iter(failed.values()))
    best = min(tried, key=lambda axis: len(tried[axis].unfit))
    if up or best == "z":
        return replace(tried[best], up=f"{best}, as asked" if up else best)
    why = str(failed["z"]).rstrip(".") if "z" in failed else "; ".join(tried["z"].unfit)
    return replace(tried[best], up=f"{best}, as with z up {why}")


def _on_a_base(parts: Sequence[PosedPart], fixed: Sequence[str], clearance_mm: float, asked: Sequence[str]) -> Draft:
    """The draft on what is fixed, or on the largest of the parts that lie lowest with which there is an order."""
    try:
        return draft(parts, fixed, clearance_mm, asked)
    except NoOrder:
        for base in () if fixed else lowest(parts)[1:_MOST_BASES]:
            with suppress(NoOrder):
                made = draft(parts, (base,), clearance_mm, asked)
                return replace(made, why_fixed="it lies lowest; with larger ones that do there is no order")
        raise
