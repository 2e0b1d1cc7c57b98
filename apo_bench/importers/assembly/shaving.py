"""Take off what no receding face explains where parts overlap a little: one of two convex pieces is cut along a plane.

Faces recede as a whole (`added_clearance`). What overlaps beyond them, such as the lip of a snap fit or a rounded edge,
is cut off at the plane across which the two pieces overlap least, and by the clearance behind it. If no straight way
out is free, what is in the way on the freest one is cut off too. So is what touches next to receded faces and would
leave them no play.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import manifold3d
import numpy as np

from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import (
    Array,
    Face,
    Hull,
    Piece,
    RoundFace,
    measure_intrusion,
    measure_world_bounds,
    pose,
    shrink_pieces,
)
from apo_bench.importers.assembly.added_clearance import TightPair, add_clearance, limit_depth
from apo_bench.importers.assembly.contact_search import NEAR_M, NEAR_RAD, SHARE
from apo_bench.importers.assembly.misplaced import find_least_overlap, measure_depth
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.importers.cad.pieces.corners import is_thick, list_body_corners, list_hull_corners
from apo_bench.scenario.layout_checks import DEEP_M

_LARGEST_LOSS = 0.02
"""Largest share of the volume of a part that is taken off it against one other part."""
_STEP_M = 1e-3  # between places along a way
_WAY_FACTOR = 1.5
"""Overlaps on the way may be deeper than those as drawn by this factor, since lips of snap fits are."""
_STOPS = 0.02
"""A seat stops a shift if the cosine of its normal with the opposite of the shift is at least this."""
_NO_FLATS = np.zeros((0, 4))


class ShavedPieces(NamedTuple):
    """The pieces of parts after overlaps were cut off."""

    pieces: dict[Path, list[Piece]]
    """Part file -> all of its pieces; only parts that were cut."""
    lines: tuple[str, ...]
    """One sentence for each pair: depth as drawn, volume taken off, and the play that results."""


_Place = tuple[PosedPart, PosedPart, float]
"""Two parts, the second one at a place, and the gap that cuts are to leave there, [mm]."""


class _Cut(NamedTuple):
    """A piece of a part after a cut."""

    of: PosedPart
    number: int
    piece: Piece
    lost_mm3: float
    """inf if nothing would be left."""


def shave_overlaps(parts: Sequence[PosedPart], clearance_mm: float, most_mm: float) -> ShavedPieces:
    """Cut off overlaps of parts up to a depth that remain after faces have receded.

    Args:
        clearance_mm: Gap that the cuts leave.
        most_mm: Parts with a deeper overlap stay as drawn.
    """
    receded, tight, _ = add_clearance(parts, clearance_mm, most_mm)
    pieces: dict[Path, list[Piece]] = {each.file: list(each.solid.pieces) for each in parts}
    cut = set[Path]()
    lines = list[str]()
    for a, b in combinations(receded, 2):
        most_m = 1e-3 * limit_depth((a, b), most_mm)
        places, depth_m = _list_tight_places(a, b, most_m)
        cuts = [(a, place, clearance_mm) for place in places]
        if depth_m <= most_m:
            own, other = (_shrink(each, 1e-3 * clearance_mm) for each in (a, b))
            shifts = _list_play_shifts(a, b, tight, 1e-3 * clearance_mm)
            cuts += [(own, replace(other, T=pose.at(shift) @ b.T), 0.0) for shift in shifts]
        lost = {a.name: 0.0, b.name: 0.0}
        allowed = {each.name: 1e9 * _LARGEST_LOSS * each.solid.volume for each in (a, b)}
        for p, q, (own, place, gap_mm) in _list_deep_pieces(cuts):
            least = min(_cut_apart(own, p, place, q, pieces, gap_mm), key=lambda each: each.lost_mm3)
            if lost[least.of.name] + least.lost_mm3 > allowed[least.of.name]:
                continue
            lost[least.of.name] += least.lost_mm3
            pieces[least.of.file][least.number] = least.piece
            cut.add(least.of.file)
        where = "as drawn" if len(places) < 2 else "as drawn or on the way to their places"
        are = f"are {1e3 * depth_m:.2g} mm inside each other {where}" if places else "touch as drawn"
        lines += [
            f"'{a.name}' and '{b.name}' {are}, where no whole face explains it: {volume:.3g} mm^3 of '{name}' are "
            f"taken off, which leaves {clearance_mm:g} mm of play"
            for name, volume in lost.items()
            if volume > 0.0
        ]
    return ShavedPieces({file: pieces[file] for file in cut}, tuple(lines))


def _list_tight_places(a: PosedPart, b: PosedPart, most_m: float) -> tuple[list[PosedPart], float]:
    """Return the second part at its place, and on the freest straight way from there if none is free.

    Returns:
        The places at which the two parts are to be cut apart, and the deepest overlap there, [m]; no places if the
        overlap as drawn is deeper than `most_m`.
    """
    depth_m = measure_intrusion(a.solid, a.T, b.solid, b.T)
    if depth_m > most_m:
        return [], depth_m
    here = [b] if depth_m > DEEP_M else []
    best = _WAY_FACTOR * most_m
    chosen = here
    for way in np.concatenate([np.eye(3), -np.eye(3)]):
        deepest = 0.0
        tight = []
        for moved in _move_along(a, b, way):
            depth = measure_intrusion(a.solid, a.T, moved.solid, moved.T)
            deepest = max(deepest, depth)
            tight += [moved] if depth > DEEP_M else []
            if deepest > best:
                break
        else:
            if deepest <= DEEP_M:
                return here, depth_m
            best, chosen = deepest, [*here, *tight]
    return chosen, max(depth_m, best if chosen is not here else 0.0)


def _move_along(a: PosedPart, b: PosedPart, way: Array) -> Iterator[PosedPart]:
    """Yield part b at places along a straight way, until its box is clear of that of part a."""
    (low, high), (own_low, own_high) = (measure_world_bounds([(each.solid, each.T)]) for each in (a, b))
    k = int(np.abs(way).argmax())
    far_m = float(high[k] - own_low[k] if way[k] > 0.0 else own_high[k] - low[k])
    for step in np.arange(_STEP_M, far_m, _STEP_M):
        yield replace(b, T=pose.at(step * way) @ b.T)


def _shrink(part: PosedPart, clearance_m: float) -> PosedPart:
    """Return a part with its fit faces receded by the clearance."""
    return replace(part, solid=replace(part.solid, pieces=shrink_pieces(part.solid, clearance_m)))


def _list_play_shifts(a: PosedPart, b: PosedPart, tight: Sequence[TightPair], clearance_m: float) -> list[Array]:
    """Return the shifts of part b, (3,), for which receded faces give it room against part a, [m]."""
    ways = list[Array]()
    for pair in tight:
        if {pair.part, pair.other} == {a.name, b.name}:
            own, sign = (a, -1.0) if pair.part == a.name else (b, 1.0)
            ways += [sign * own.T[:3, :3] @ way for face in pair.faces for way in _list_play_ways(own.solid.face(face))]
    pairs = [
        (a.solid.face(each.a), b.solid.face(each.b))
        for each in find_facing_pairs(a.solid, a.T, b.solid, b.T, gap_m=NEAR_M, angle_rad=NEAR_RAD, share=SHARE)
    ]
    seats = [mine for mine, its in pairs if not (mine.fit or its.fit)]
    if not all(isinstance(face, Face) for face in seats):
        return []  # a shaft with the play that was drawn
    stops = [a.T[:3, :3] @ face.normal for face in seats if isinstance(face, Face)]
    free = [way for way in ways if all(way @ stop > -_STOPS for stop in stops)]
    return [clearance_m * way for way in np.unique(np.round(free, 9).reshape(-1, 3), axis=0)]


def _list_play_ways(face: Face | RoundFace) -> list[Array]:
    """Return the directions from a receded face in which its part has play, (3,) each, frame of the part."""
    return [face.normal] if isinstance(face, Face) else [s * face.frame[:3, k] for k in (0, 1) for s in (-1.0, 1.0)]


def _list_deep_pieces(cuts: Sequence[_Place]) -> Iterator[tuple[Piece, Piece, _Place]]:
    """Yield the pairs of pieces of two parts that are inside each other, and where they are."""
    for cut in cuts:
        a, b, _ = cut
        for p in a.solid.pieces:
            if measure_depth(a.T, (p,), b.T, b.solid.pieces) > DEEP_M:
                yield from ((p, q, cut) for q in b.solid.pieces if measure_depth(a.T, (p,), b.T, (q,)) > DEEP_M)


def _cut_apart(
    a: PosedPart, p: Piece, b: PosedPart, q: Piece, pieces: dict[Path, list[Piece]], clearance_mm: float
) -> Iterator[_Cut]:
    """Yield the two ways to cut apart pieces p of part a and q of part b: off the first, and off the second."""
    for (own, mine), (other, its) in (((a, p), (b, q)), ((b, q), (a, p))):
        T = pose.inverse(own.T) @ other.T
        there = Hull(its.name, pose.apply(T, its.corners))
        n, at = find_least_overlap(mine, there)
        index = next(i for i, each in enumerate(pieces[own.file]) if each.name == mine.name)
        yield _cut_piece(own, index, pieces[own.file][index], n, 1e3 * at - clearance_mm)


def _cut_piece(of: PosedPart, index: int, piece: Piece, n: Array, d_mm: float) -> _Cut:
    """Cut a piece along a plane, and keep what is below it, n . x <= d, [mm]."""
    body: Any = manifold3d.Manifold.hull_points(1e3 * piece.corners)
    below = body.trim_by_plane(-n, -d_mm)
    corners = list_body_corners(below)
    lost = float(body.volume() - below.volume())
    if len(corners) < 4 or not is_thick(corners):
        return _Cut(of, index, piece, np.inf)
    return _Cut(of, index, Hull(piece.name, 1e-3 * list_hull_corners(corners, _NO_FLATS)), lost)
