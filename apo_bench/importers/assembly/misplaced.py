"""Find parts that overlap another one, or are apart from it, on one side only: their place may be wrong."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import (
    Array,
    Hull,
    Piece,
    Solid,
    find_separating_axes,
    measure_intrusion,
    measure_intrusion_depths,
    measure_mate,
    pose,
    project_on_axes,
)
from apo_bench.importers.assembly.contact_search import COAXIAL_M, NEAR_M, NEAR_RAD, find_coaxial_pairs
from apo_bench.importers.assembly.posed_parts import PosedPart
from apo_bench.scenario.layout_checks import DEEP_M

_FURTHER_M = 1e-5  # beyond the depth of the overlap
_FARTHEST_M = 2.5e-3  # of a part from its right place
_FACING_SHARE = 0.5  # of the smaller of two faces across a gap that must face the other
_SAME = 0.999  # cosine of directions that are the same


def list_misplaced(parts: Sequence[PosedPart]) -> list[str]:
    """Return a sentence for each pair of parts of which one seems to be at a wrong place."""
    gaps = [gap for pair in combinations(parts, 2) for gap in _list_gaps(*pair)]
    sentences = []
    for a, b in combinations(parts, 2):
        sentences.append(describe_overlap(a, b) or _describe_offset(a, b) or _describe_gap(a, b, gaps))
    return list(filter(None, sentences))


def describe_overlap(a: PosedPart, b: PosedPart) -> str:
    """Return a sentence if a shift by the depth of their overlap would free two parts; empty if it would not."""
    deepest = find_deepest_pieces(a.solid, a.T, b.solid, b.T)
    if deepest is None:
        return ""
    p, q, depth_m = deepest
    n, _ = find_least_overlap(p, Hull(q.name, pose.apply(pose.inverse(a.T) @ b.T, q.corners)))
    way = -(a.T[:3, :3] @ n)
    if not _is_free(a, (depth_m + _FURTHER_M) * way, b):
        return ""
    return (
        f"'{a.name}' is {1e3 * depth_m:.2g} mm inside '{b.name}' on one side only: shifted by this along "
        f"({_format_direction(way)}) it would be free, so its place in the file may be wrong"
    )


def _is_free(a: PosedPart, shift: Array, b: PosedPart) -> bool:
    """Whether a part that is shifted does not overlap another one."""
    T = np.array(a.T)
    T[:3, 3] += shift
    return measure_intrusion(a.solid, T, b.solid, b.T) <= DEEP_M


def _format_direction(way: Array) -> str:
    return ", ".join(f"{x:.2g}" for x in np.round(way, 2) + 0.0)


def _describe_offset(a: PosedPart, b: PosedPart) -> str:
    """Return a sentence if a shaft is farther off the axis of its hole than their play; empty if none is."""
    for wall, other, play_m in find_coaxial_pairs(a.solid, a.T, b.solid, b.T, _FARTHEST_M):
        off_m = measure_mate(wall, a.T, other, b.T).gap_m
        if max(play_m, COAXIAL_M) < off_m and abs(play_m) < _FARTHEST_M:
            return (
                f"the axes of '{a.name}.{wall.name}' and '{b.name}.{other.name}' are {1e3 * off_m:.2g} mm apart, so "
                "the place of one of the two parts in the file may be wrong"
            )
    return ""


class _Gap(NamedTuple):
    """Two flat faces that face each other across a gap or touch."""

    a: str
    b: str
    gap_m: float
    normal: Array
    """From a to b, world, (3,)."""


def _list_gaps(a: PosedPart, b: PosedPart) -> Iterator[_Gap]:
    """Yield the gaps between the flat faces of two parts, in both orders."""
    for pair in find_facing_pairs(
        a.solid, a.T, b.solid, b.T, gap_m=_FARTHEST_M, angle_rad=NEAR_RAD, share=_FACING_SHARE
    ):
        if pair.a in a.solid.faces and pair.b in b.solid.faces:
            n = a.T[:3, :3] @ a.solid.faces[pair.a].normal
            yield _Gap(a.name, b.name, pair.gap_m, n)
            yield _Gap(b.name, a.name, pair.gap_m, -n)


def _describe_gap(a: PosedPart, b: PosedPart, gaps: Sequence[_Gap]) -> str:
    """Return a sentence if two parts are apart on one side only, where no other part stops them; empty if not."""
    for gap in gaps:
        if (gap.a, gap.b) != (a.name, b.name) or gap.gap_m < NEAR_M:
            continue
        along = [(each, float(each.normal @ gap.normal)) for each in gaps if each.a in gap[:2]]
        # Something else stops one of the two, or there is play on both sides.
        is_stopped = any(
            (each.gap_m < NEAR_M and cosine * (1 if each.a == gap.a else -1) > _SAME)
            or (each[:2] == gap[:2] and cosine < -_SAME)
            for each, cosine in along
        )
        if not is_stopped and _is_free(a, gap.gap_m * gap.normal, b):
            return (
                f"'{a.name}' is {1e3 * gap.gap_m:.2g} mm away from '{b.name}' along ({_format_direction(gap.normal)}), "
                "and nothing stops it there: if they are meant to touch, its place in the file is wrong"
            )
    return ""


def find_deepest_pieces(a: Solid, T_a: Array, b: Solid, T_b: Array) -> tuple[Piece, Piece, float] | None:
    """Return the two pieces of posed solids that are deepest inside each other, and the depth, [m]; None if none is."""
    own = [(measure_depth(T_a, (piece,), T_b, b.pieces), k) for k, piece in enumerate(a.pieces)]
    depth_m, k = max(own)
    if depth_m <= DEEP_M:
        return None
    p = a.pieces[k]
    return p, max(b.pieces, key=lambda piece: measure_depth(T_a, (p,), T_b, (piece,))), depth_m


def measure_depth(T_a: Array, own: tuple[Piece, ...], T_b: Array, other: tuple[Piece, ...]) -> float:
    """Return how deep posed pieces are inside each other, [m]."""
    return float(measure_intrusion_depths(own, T_a[:3, :3], T_a[None, :3, 3], other, T_b, 0.0)[0])


def find_least_overlap(p: Piece, q: Hull) -> tuple[Array, float]:
    """Return the direction from p to q across which they overlap least, (3,), and where q begins along it, [m]."""
    axes = find_separating_axes(p, np.eye(3), q, np.eye(3))
    at_p, reach_p = project_on_axes(p, np.eye(3), axes)
    at_q, reach_q = project_on_axes(q, np.eye(3), axes)
    k = int((reach_p + reach_q - np.abs(at_p - at_q)).argmin())
    sign = 1.0 if at_q[k] >= at_p[k] else -1.0
    return sign * axes[k], float(sign * at_q[k] - reach_q[k])
