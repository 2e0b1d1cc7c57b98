"""Play for parts that were drawn without any: mating faces of the smaller part recede. And the play of those that were
drawn with it: they are made as thick as there is room, so that walls touch, and the clearance makes them as drawn.

Printed and moulded parts are often drawn line to line, or a little inside each other. Physics then finds no way in. So
faces recede to where they only touch, and by the clearance; where nothing would be left of a piece, those of the larger
part do.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations

import numpy as np

from apo_bench.assembly import Contact, PartFace, contact_kind, geometric_play
from apo_bench.assembly.facing import facing
from apo_bench.errors import InputError
from apo_bench.geometry import Solid, intrusion, physical_pieces
from apo_bench.importers.assembly.posed import PosedPart
from apo_bench.importers.assembly.touching import NEAR_M, NEAR_RAD, NO_PLAY_MM, PLAY_M, SHARE, walls_without_play
from apo_bench.scenario.checks import DEEP_M
from apo_bench.scenario.parts.fit import with_fit

LOOSEN_MM = 0.2
"""Faces that are deeper in each other are not made looser."""
_ALIKE_MM = 0.02
_OVER_MM = 1e-5
_DIGITS = 5


def loosened(
    parts: Sequence[PosedPart], clearance_mm: float, most_mm: float = LOOSEN_MM
) -> tuple[tuple[PosedPart, ...], tuple[str, ...]]:
    """The parts, some of whose faces are fit that their files do not mark so, and what is to be said of that.

    Args:
        clearance_mm: By how much these recede; with none, nothing is changed.
        most_mm: Faces that are deeper in each other stay where they are; 0: all do.
    """
    made = {each.name: each for each in parts}
    notes = list[str]()
    for pair in combinations(parts, 2) if most_mm and clearance_mm else ():
        wide, thin = sorted(pair, key=lambda each: -each.solid.volume)
        why = ""
        for own, other in ((thin, wide), (wide, thin)):
            tight = _tight(own, other, most_mm)
            before = made[own.name].fit
            fit = {**before, **{face: max(mm, before.get(face, 0.0)) for face, mm in tight.items()}}
            try:
                fitted = _with_fit(own, fit, clearance_mm)
            except InputError as error:
                why = why or f"'{own.name}' has no play in '{other.name}' and is given none: {str(error).rstrip('.')}"
                continue
            if tight:
                made[own.name] = fitted
                notes.append(_said(own.name, other.name, tight))
            break
        else:
            notes.append(why)
    return tuple(made.values()), tuple(notes)


def filled(parts: Sequence[PosedPart]) -> tuple[tuple[PosedPart, ...], float | None, tuple[str, ...]]:
    """The parts, some as thick as there is room between flat walls; the play per side, [mm]; what is to be said.

    The smaller part of two is, where it stands in the middle, between walls of the other that are up to twice `PLAY_M`
    farther apart than its own. There is one clearance in a scenario, so play that differs stays as it was drawn.
    """
    drawn = {each.name: each for each in parts}
    gaps = {
        (thin.name, wide.name): _gaps(thin, wide)
        for pair in combinations(parts, 2)
        for wide, thin in [sorted(pair, key=lambda each: -each.solid.volume)]
    }
    held = {
        (thin, wide): _opposed(drawn[thin].solid, {face: mm for face, (mm, walled) in faces.items() if walled})
        for (thin, wide), faces in gaps.items()
    }
    plays = [mm for faces in held.values() for mm in faces.values()]
    play_mm = round(float(np.median(plays)), 3) if plays else 0.0
    made = dict(drawn)
    notes = []
    for (own, other), faces in held.items():
        # A wall that touches a third part, or is nearer to it, stays where it is.
        nearest = [min(g[face][0] for (a, _), g in gaps.items() if a == own and face in g) for face in faces]
        if not faces or max(abs(mm - play_mm) for mm in (*faces.values(), *nearest)) > _ALIKE_MM:
            continue
        part = made[own]
        fit = {**part.fit, **{face: -round(mm, _DIGITS) for face, mm in faces.items()}}
        others = [each for each in made.values() if each is not part]
        with suppress(InputError):  # of a box with another face on that side
            fitted = _with_fit(drawn[own], fit, play_mm)
            if _deepest(fitted, others) <= max(DEEP_M, _deepest(part, others)):
                made[own] = fitted
        if made[own] is part:
            continue
        notes.append(
            f"'{own}' was drawn with {play_mm:g} mm of play per side in '{other}': {len(faces)} of its faces are taken "
            f"to touch, as stated under [parts.{own}.fit], so that contacts correct it; the clearance leaves the play"
        )
    return tuple(made.values()), (play_mm if notes else None), tuple(notes)


def _opposed(solid: Solid, gaps: Mapping[str, float]) -> dict[str, float]:
    """Those of some flat faces that have an opposite one among them."""
    n = {face: solid.faces[face].normal for face in gaps}
    return {face: mm for face, mm in gaps.items() if any(n[face] @ n[other] < -1.0 + 1e-6 for other in gaps)}


def _with_fit(part: PosedPart, fit: Mapping[str, float], clearance_mm: float) -> PosedPart:
    """A part with all faces of `fit`, those of its own fit where they are already, and pieces that can recede."""
    solid = with_fit(part.solid, {face: mm for face, mm in fit.items() if face not in part.fit})
    physical_pieces(solid, 1e-3 * clearance_mm)
    return replace(part, solid=solid, fit=fit)


def _deepest(part: PosedPart, others: Sequence[PosedPart]) -> float:
    """How deep a part is in any of the others, [m]."""
    return max(intrusion(part.solid, part.T, each.solid, each.T) for each in others)


def _gaps(own: PosedPart, other: PosedPart) -> dict[str, tuple[float, bool]]:
    """Flat faces of the first part near the second -> the gap, [mm], and whether another face is opposite as far."""
    found = {c: 1e3 * gap_m for c, gap_m in _near(own, other, PLAY_M).items() if c.manipulated.face in own.solid.faces}
    apart = [contact for contact, mm in found.items() if mm > 1e3 * NEAR_M]
    walled = {
        contact
        for pair in _opposite(own, other, apart)
        if abs(found[pair[0]] - found[pair[1]]) < _ALIKE_MM
        for contact in pair
    }
    # Of a face that is near to several the nearest comes last.
    order = sorted(found.items(), key=lambda each: -each[1])
    return {contact.manipulated.face: (mm, contact in walled) for contact, mm in order}


def _near(own: PosedPart, other: PosedPart, gap_m: float) -> dict[Contact, float]:
    """Faces of two parts that look at each other and are no farther apart -> the gap, [m]."""
    found = facing(own.solid, own.T, other.solid, other.T, gap_m=gap_m, angle_rad=NEAR_RAD, share=SHARE)
    return {Contact(PartFace(own.name, each.a), PartFace(other.name, each.b)): each.gap_m for each in found}


def _opposite(own: PosedPart, other: PosedPart, contacts: Iterable[Contact]) -> tuple[tuple[Contact, Contact], ...]:
    """Opposite flat walls between two parts, none of which recedes."""
    both = (own, other)
    return walls_without_play({each.name: each.solid for each in both}, {each.name: each.T for each in both}, contacts)


def _said(own: str, other: str, tight: Mapping[str, float]) -> str:
    deepest = max(tight.values())
    more = f", in which it is up to {deepest:.3g} mm deep" if deepest > _OVER_MM else ""
    return (
        f"'{own}' was drawn without play in '{other}'{more}: {len(tight)} of its faces recede to where they touch, and "
        f"by the clearance, as stated under [parts.{own}.fit]; take them out there if a press fit is meant"
    )


def _tight(own: PosedPart, other: PosedPart, most_mm: float) -> Mapping[str, float]:
    """Faces of the first part that need play, and how deep each of them is in the second one, [mm]."""
    found = {contact: gap_m for contact, gap_m in _near(own, other, 1e-3 * most_mm).items() if gap_m < NEAR_M}
    held = {contact for pair in _opposite(own, other, found) for contact in pair}
    deep = [(c.manipulated.face, -1e3 * gap) for c, gap in found.items() if c in held or gap < -NEAR_M]
    deep += _shafts(own, other, found, most_mm)
    # Of a face that touches several the deepest comes last.
    return {face: round(max(0.0, mm), _DIGITS) for face, mm in sorted(deep)}


def _shafts(
    own: PosedPart, other: PosedPart, found: Mapping[Contact, float], most_mm: float
) -> Iterator[tuple[str, float]]:
    """Shafts that are as thick as the hole around them, or thicker, and the holes of such."""
    for mine, its in found:
        a, b = own.solid.face(mine.face), other.solid.face(its.face)
        play_mm = 1e3 * geometric_play(a, b)
        if contact_kind(a, b) == "shaft in hole" and -most_mm <= play_mm <= NO_PLAY_MM and not (a.fit or b.fit):
            yield mine.face, -play_mm
