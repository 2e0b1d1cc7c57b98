"""Give play to parts that were drawn line to line or inside each other: whole faces of one part recede.

Such faces recede by their overlap and by the clearance. Of a thread or a press fit the hole widens; otherwise the
smaller part recedes, and the larger one if the smaller one is too thin.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Contact, PartFace
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.errors import InputError
from apo_bench.geometry import measure_intrusion, shrink_pieces
from apo_bench.importers.assembly.contact_search import (
    NEAR_M,
    NEAR_RAD,
    NO_PLAY_MM,
    SHARE,
    find_coaxial_pairs,
    find_walls_without_play,
)
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.scenario.layout_checks import DEEP_M
from apo_bench.scenario.parts.fit_faces import mark_fit_faces

_LARGEST_SHARE = 0.2
"""Faces do not recede by more than this share of the least side of the smaller part."""
_DIGITS = 5  # decimals of a depth in mm


class TightPair(NamedTuple):
    """Two parts without play between them, of which one recedes."""

    part: str
    """The part that recedes."""
    other: str
    depth_mm: float
    """Deepest overlap of their faces as drawn."""
    faces: tuple[str, ...]
    """The faces that recede."""

    def describe(self, clearance_mm: float) -> str:
        """Return one sentence: depth as drawn, what recedes, and the play that results."""
        overlap = f"{self.depth_mm:.2g} mm inside" if self.depth_mm > 0.0 else "without play in"
        recede = "recede" if len(self.faces) > 1 else "recedes"
        return (
            f"'{self.part}' was drawn {overlap} '{self.other}': {', '.join(self.faces)} of '{self.part}' {recede} to "
            f"where they touch, and by {clearance_mm:g} mm of play a side, as stated under [parts.{self.part}.fit]"
        )


def add_clearance(
    parts: Sequence[PosedPart], clearance_mm: float, most_mm: float
) -> tuple[tuple[PosedPart, ...], tuple[TightPair, ...], tuple[str, ...]]:
    """Return the parts with the faces that need play marked as fit.

    Args:
        clearance_mm: How far marked faces recede beyond the overlap; 0 changes nothing.
        most_mm: Faces with a larger overlap stay as drawn; 0 changes nothing.

    Returns:
        The parts in the given order, the pairs of which one recedes, and a sentence for each part that is too thin.
    """
    changed = {each.name: each for each in parts}
    tight = list[TightPair]()
    notes = list[str]()
    for pair in combinations(parts, 2) if most_mm and clearance_mm else ():
        for own, other in _order_by_receding(pair):
            depths = _find_tight_faces(own, other, limit_depth(pair, most_mm))
            before = changed[own.name].fit
            fit = {**before, **{face: max(mm, before.get(face, 0.0)) for face, mm in depths.items()}}
            try:
                solid = mark_fit_faces(own.solid, {face: mm for face, mm in fit.items() if face not in own.fit})
                shrink_pieces(solid, 1e-3 * clearance_mm)
            except InputError as error:
                notes.append(f"'{own.name}' gets no play in '{other.name}': {str(error).rstrip('.')}")
                continue
            if depths:
                changed[own.name] = replace(own, solid=solid, fit=fit)
                tight.append(TightPair(own.name, other.name, max(depths.values()), tuple(depths)))
            break
    return tuple(changed.values()), tuple(tight), tuple(notes)


def _order_by_receding(pair: tuple[PosedPart, PosedPart]) -> tuple[tuple[PosedPart, PosedPart], ...]:
    """Return both orders of two parts, the one first whose first part should recede: a hole that is too narrow, else
    the smaller part."""
    wide, thin = sorted(pair, key=lambda each: -each.solid.volume)
    pressed = [a for a, _, play_m in _list_rounds(thin, wide) if 1e3 * play_m < -NO_PLAY_MM]
    orders = ((thin, wide), (wide, thin))
    return orders[::-1] if any(not thin.solid.rounds[face].hole for face in pressed) else orders


def limit_depth(pair: Sequence[PosedPart], most_mm: float) -> float:
    """Return the largest depth by which faces of two parts may recede, [mm]."""
    return min(most_mm, *(1e3 * _LARGEST_SHARE * float(np.ptp(each.solid.bounds, axis=0).min()) for each in pair))


def _find_tight_faces(own: PosedPart, other: PosedPart, most_mm: float) -> Mapping[str, float]:
    """Return the faces of `own` that need play against `other` -> the depth of their overlap, [mm], 0 if none."""
    pairs = find_facing_pairs(
        own.solid, own.T, other.solid, other.T, gap_m=1e-3 * most_mm, angle_rad=NEAR_RAD, share=SHARE
    )
    gaps = {Contact(PartFace(own.name, each.a), PartFace(other.name, each.b)): each.gap_m for each in pairs}
    # Touching or overlapping, by no more than the parts do.
    deepest = measure_intrusion(own.solid, own.T, other.solid, other.T) + NEAR_M if gaps else 0.0
    gaps = {contact: gap_m for contact, gap_m in gaps.items() if -deepest < gap_m < NEAR_M}
    solids = {own.name: own.solid, other.name: other.solid}
    walls = find_walls_without_play(solids, {own.name: own.T, other.name: other.T}, gaps)
    # Both walls of a slot without play, even where they do not overlap.
    held = {contact for pair in walls for contact in pair}
    deep = [(c.manipulated.face, -1e3 * gap) for c, gap in gaps.items() if c in held or gap < -DEEP_M]
    deep += [(face, -1e3 * play) for face, _, play in _list_rounds(own, other) if -most_mm <= 1e3 * play <= NO_PLAY_MM]
    # A face that mates with several faces recedes by the largest overlap: pairs are sorted, so the deepest wins.
    return {face: round(max(0.0, mm), _DIGITS) for face, mm in sorted(deep)}


def _list_rounds(own: PosedPart, other: PosedPart) -> Iterator[tuple[str, str, float]]:
    """Yield the coaxial round faces of two parts, none marked as fit, and the difference of their radii, [m]."""
    for a, b, play_m in find_coaxial_pairs(own.solid, own.T, other.solid, other.T):
        if not (a.fit or b.fit):
            yield a.name, b.name, play_m
