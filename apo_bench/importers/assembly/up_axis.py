"""Choose the up axis and the base part of an assembly: as stated, or the first choice that works."""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

from apo_bench.errors import InputError, require
from apo_bench.importers.assembly.added_clearance import add_clearance
from apo_bench.importers.assembly.choices import DEFAULT_CHOICES, AssemblyChoices
from apo_bench.importers.assembly.new_scenario import NewScenario, NoAssemblyOrder, find_lowest_part, new_scenario
from apo_bench.importers.assembly.posed_parts import PosedPart, place_on_table

_UP_AXES = ("z", "-z", "x", "-x", "y", "-y")  # in the order of the attempts
_MOST_BASES = 3  # of the lowest parts that are tried as base


def new_upright_scenario(parts: Sequence[PosedPart], choices: AssemblyChoices = DEFAULT_CHOICES) -> NewScenario:
    """Make a scenario from an assembly with one axis of its poses up.

    Raises:
        InputError: No part has that name, there is no room on the table, or the user wants to choose the fits.
        RuntimeError: Parts are inside each other, or there is no order in which they can be put together.
    """
    clearance_mm = choices.clearance_mm
    parts, tight, notes = add_clearance(parts, clearance_mm, choices.most_overlap_mm)
    fits = tuple(each.describe(clearance_mm) for each in tight)
    require(
        choices.fits != "ask" or not fits,
        f"{len(fits)} pairs of parts have no play: {'; '.join(fits)}. Give fits = auto to change them so, or refuse.",
    )
    scenario, assumed = _try_fastened(parts, choices)
    return replace(scenario, notes=(*fits, *notes, *assumed, *scenario.notes))


def _try_fastened(parts: Sequence[PosedPart], choices: AssemblyChoices) -> tuple[NewScenario, tuple[str, ...]]:
    """Make the scenario; if there is no order, take what nothing carries to be fastened, and note it."""
    try:
        return _try_axes(parts, choices), ()
    except (NoAssemblyOrder, InputError):
        if choices.fasteners != "clamp":
            raise
        # What nothing carries in the finished assembly is held by something that the file does not show.
        scenario = _try_axes([replace(each, held=True) for each in parts], choices)
        marked = {each.name for each in parts if each.held}
        return scenario, tuple(
            f"nothing carries '{placing.moves[0]}' at its place, and no fastener is drawn: it is taken to be fastened "
            "there, and clamped"
            for placing in scenario.order
            if placing.clamped and placing.moves[0] not in marked
        )


def _try_axes(parts: Sequence[PosedPart], choices: AssemblyChoices) -> NewScenario:
    """Make the scenario with the stated axis up, or with z or an axis for which more parts can be grasped, or come from
    above."""
    up = choices.up
    found: dict[str, NewScenario] = {}
    failed: dict[str, NoAssemblyOrder | InputError] = {}
    for axis in (up,) if up else _UP_AXES:
        try:
            found[axis] = _try_bases(place_on_table(parts, axis), choices)
        except (NoAssemblyOrder, InputError) as error:
            failed[axis] = error
            continue
        if not any(_list_hindrances(found[axis])[: 2 if axis == "z" else None]):  # z may need fixtures
            break
    if not found:
        raise next(iter(failed.values()))  # that of the first axis
    best = min(found, key=lambda axis: [len(each) for each in _list_hindrances(found[axis])])
    if up or best == "z":
        return replace(found[best], up=f"{best}, as asked" if up else best)
    why = str(failed["z"]).rstrip(".") if "z" in failed else "; ".join(next(filter(None, _list_hindrances(found["z"]))))
    return replace(found[best], up=f"{best}, as with z up {why}")


def _list_hindrances(scenario: NewScenario) -> tuple[Collection[str], ...]:
    """Return the notes on parts that cannot be grasped, those on parts that do not come from above, and the parts that
    start in a fixture."""
    aside = [f"'{placing.moves[0]}' {placing.why}" for placing in scenario.order if not placing.from_above]
    return scenario.unfit, aside, scenario.fixtures


def _try_bases(parts: Sequence[PosedPart], choices: AssemblyChoices) -> NewScenario:
    """Make the scenario on the fixed parts, or on the largest of the lowest parts for which an order exists."""
    try:
        return new_scenario(parts, choices.fixed, choices.clearance_mm, choices.order)
    except NoAssemblyOrder:
        for base in () if choices.fixed else find_lowest_part(parts)[1:_MOST_BASES]:
            with suppress(NoAssemblyOrder):
                scenario = new_scenario(parts, (base,), choices.clearance_mm, choices.order)
                return replace(scenario, why_fixed="one of the lowest; with larger ones there is no order")
        raise
