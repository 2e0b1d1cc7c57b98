"""Add clearance to parts that were drawn line to line: mating faces of the smaller part recede.

Parts for printing or moulding are often drawn without play, or overlapping a little, and physics then cannot insert
them. Such faces recede by their overlap and by the clearance. If the smaller part is too thin, the larger one recedes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from apo_bench.assembly import Contact, PartFace, classify_contact, compute_geometric_play
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.errors import InputError
from apo_bench.geometry import shrink_pieces
from apo_bench.importers.assembly.contact_search import NEAR_M, NEAR_RAD, NO_PLAY_MM, SHARE, find_walls_without_play
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.scenario.parts.fit_faces import mark_fit_faces

MOST_OVERLAP_MM = 0.2
"""Faces with a larger overlap do not recede: they are a press fit or a thread."""
_DIGITS = 5  # decimals of a depth in mm


def add_clearance(
    parts: Sequence[PosedPart], clearance_mm: float, most_mm: float = MOST_OVERLAP_MM
) -> tuple[tuple[PosedPart, ...], tuple[str, ...]]:
    """Return the parts with the faces that need play marked as fit, and notes on the changes.

    Args:
        clearance_mm: How far marked faces recede beyond the overlap; 0 changes nothing.
        most_mm: Faces with a larger overlap stay as drawn; 0 changes nothing.

    Returns:
        The parts in the given order, and one sentence for each pair of which a part was changed or is too thin.
    """
    changed = {each.name: each for each in parts}
    notes = list[str]()
    for pair in combinations(parts, 2) if most_mm and clearance_mm else ():
        wide, thin = sorted(pair, key=lambda each: -each.solid.volume)
        # The smaller part recedes if it can; otherwise the larger one.
        for own, other in ((thin, wide), (wide, thin)):
            tight = _find_tight_faces(own, other, most_mm)
            before = changed[own.name].fit
            fit = {**before, **{face: max(mm, before.get(face, 0.0)) for face, mm in tight.items()}}
            try:
                solid = mark_fit_faces(own.solid, {face: mm for face, mm in fit.items() if face not in own.fit})
                shrink_pieces(solid, 1e-3 * clearance_mm)
            except InputError as error:
                notes.append(f"'{own.name}' gets no play in '{other.name}': {str(error).rstrip('.')}")
                continue
            if tight:
                changed[own.name] = replace(own, solid=solid, fit=fit)
                notes.append(
                    f"'{own.name}' was drawn without play in '{other.name}': {len(tight)} of its faces recede to where "
                    f"they touch, and by the clearance, as stated under [parts.{own.name}.fit]; remove them there for "
                    "a press fit"
                )
            break
    return tuple(changed.values()), tuple(notes)


def _find_tight_faces(own: PosedPart, other: PosedPart, most_mm: float) -> Mapping[str, float]:
    """Return the faces of `own` that need play against `other` -> the depth of their overlap, [mm], 0 if none."""
    pairs = find_facing_pairs(
        own.solid, own.T, other.solid, other.T, gap_m=1e-3 * most_mm, angle_rad=NEAR_RAD, share=SHARE
    )
    gaps = {Contact(PartFace(own.name, each.a), PartFace(other.name, each.b)): each.gap_m for each in pairs}
    gaps = {contact: gap_m for contact, gap_m in gaps.items() if gap_m < NEAR_M}  # touching or overlapping
    solids = {own.name: own.solid, other.name: other.solid}
    walls = find_walls_without_play(solids, {own.name: own.T, other.name: other.T}, gaps)
    # Both walls of a slot without play, even where they do not overlap.
    held = {contact for pair in walls for contact in pair}
    deep = [(c.manipulated.face, -1e3 * gap) for c, gap in gaps.items() if c in held or gap < -NEAR_M]
    deep += _find_tight_shafts(own, other, gaps, most_mm)
    # A face that mates with several faces recedes by the largest overlap: pairs are sorted, so the deepest wins.
    return {face: round(max(0.0, mm), _DIGITS) for face, mm in sorted(deep)}


def _find_tight_shafts(
    own: PosedPart, other: PosedPart, gaps: Mapping[Contact, float], most_mm: float
) -> Iterator[tuple[str, float]]:
    """Yield round faces of `own` in shaft-hole pairs without play, and their overlap of radii, [mm].

    Args:
        gaps: The pairs of faces that touch or overlap, face of `own` first.
        most_mm: Pairs with a larger overlap are left out.
    """
    for mine, its in gaps:
        a, b = own.solid.face(mine.face), other.solid.face(its.face)
        play_mm = 1e3 * compute_geometric_play(a, b)
        if classify_contact(a, b) == "shaft in hole" and -most_mm <= play_mm <= NO_PLAY_MM and not (a.fit or b.fit):
            yield mine.face, -play_mm
