"""Pairs of faces of which at least one is round: how far off, how far askew, how much of each other they cover.

What is measured of a pair are as many numbers as its contact has equations (`apo_bench.assembly.projection`), lengths
first: how far off an axis is, across the other one or in front of a plane, then how far a cone is from its seat; then
tilts. A turn about the axis changes none of them, so it does not matter how a part of revolution was observed turned.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import final

import numpy as np

from apo_bench.assembly.contact_kinds import classify_contact, compute_geometric_play
from apo_bench.geometry import Array, Face, RoundFace, Solid, measure_angle, measure_mate, pose

_TIGHTEST_M = -0.1e-3
_LOOSEST_M = 0.6e-3
"""A hole whose radius is less larger than that of a shaft, or more, is not the one that the shaft is for."""
_SAME_M = 1e-9


@final
@dataclass(frozen=True, eq=False)
class FacingPair:
    """Two faces that look at each other, one of which covers part of the other; of round ones axes count as normals."""

    a: str
    """The face of the first solid."""
    b: str
    """The face of the second one."""
    gap_m: float
    """From the middle of the overlap, on b, to the plane of a: above 0 apart, below 0 inside each other; of round faces
    how far walls are from where they should be."""
    angle_rad: float
    """Between the normal of a and the opposite of that of b; between axes, or between an axis and a plane."""
    share: float
    """Area of the overlap over that of the smaller face, 0 to 1; what is common of the lengths of round faces over the
    shorter one; of cones that of their radii."""
    residual: Array
    """(r,): lengths, [m], then tilts, [rad] while small: the gap and the parts of the normal of a along two axes in the
    plane of b."""
    slope: Array
    """(r, 6): its derivative by a twist (v, w) of the first solid in the world, about the origin, b at rest."""
    half_m: tuple[float, ...]
    """Half the extent of the overlap across the axis of each tilt, so that a tilt about it opens it by as much."""
    lengths: int = 1
    """How many of the residuals are lengths; the others are tilts."""


@lru_cache(maxsize=1024)
def find_round_pairs(a: Solid, b: Solid) -> tuple[tuple[Face | RoundFace, Face | RoundFace], ...]:
    """The faces of two solids, at least one of them round, whose kinds and sizes can make a contact."""
    every: list[list[Face | RoundFace]] = [[*solid.faces.values(), *solid.rounds.values()] for solid in (a, b)]
    return tuple(
        (face, other)
        for face, other in product(*every)
        if classify_contact(face, other) not in (None, "plane on plane")
        and _TIGHTEST_M <= compute_geometric_play(face, other) <= _LOOSEST_M
    )


def measure_round(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> FacingPair:
    """Measure two posed faces that can make a contact, of which at least one is round."""
    if isinstance(a, Face) or isinstance(b, Face):
        return _shaft_on_plane(a, T_a, b, T_b)
    return _in_hole(a, T_a, b, T_b) if classify_contact(a, b) == "shaft in hole" else _cone(a, T_a, b, T_b)


def _shaft_on_plane(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> FacingPair:
    (shaft, T_shaft), (flat, T_flat) = ((b, T_b), (a, T_a)) if isinstance(a, Face) else ((a, T_a), (b, T_b))
    assert isinstance(shaft, RoundFace)
    assert isinstance(flat, Face)
    n = T_flat[:3, :3] @ flat.normal
    u = T_shaft[:3, :3] @ shaft.axis
    touch = measure_mate(shaft, T_shaft, flat, T_flat)
    middle = touch.points.mean(axis=0)
    height = float(touch.off.mean(axis=0) @ n)
    # Of an axis through p along u over a plane n: d(n . p) = n . v + (p x n) . w, and d(n . u) = (u x n) . w.
    slope = np.array([[*n, *np.cross(middle, n)], [0.0, 0.0, 0.0, *np.cross(u, n)]])
    whole = min(shaft.length, float(np.ptp(flat.outline @ (T_flat[:3, :3].T @ u))))
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([height, n @ u]),
        slope=-slope if isinstance(a, Face) else slope,
        lengths=1,
        gap_m=height,
        angle_rad=touch.angle_rad,
        share=touch.length_m / whole if whole > 0.0 else 0.0,
        half_m=(touch.length_m / 2,),
    )


def _in_hole(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> FacingPair:
    """A cylinder in a cylinder."""
    touch = measure_mate(a, T_a, b, T_b)
    u = T_a[:3, :3] @ a.axis
    w = T_b[:3, :3] @ b.axis
    u = u if u @ w > 0.0 else -u
    across = (T_b[:3, :3] @ b.frame[:3, :2]).T
    p = touch.points.mean(axis=0)
    off = across @ touch.off.mean(axis=0)
    half = touch.length_m / 2
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([*off, *(across @ u)]),
        slope=np.array([*_offsets(across, p), *_tilts(across, u)]),
        lengths=2,
        gap_m=float(np.linalg.norm(off)),
        angle_rad=touch.angle_rad,
        share=touch.length_m / min(a.length, b.length),
        half_m=(half, half),
    )


def _cone(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> FacingPair:
    """A cone in a cone, or on a rim, compared where both have one radius."""
    u = T_a[:3, :3] @ a.wider
    w = T_b[:3, :3] @ b.wider
    across = (T_b[:3, :3] @ b.frame[:3, :2]).T
    slope = abs(a.slope if a.kind == "cone" else b.slope)
    rows = np.array([*across, w * slope / np.hypot(1.0, slope)])
    low = max(min(a.radii), min(b.radii))
    high = min(max(a.radii), max(b.radii))
    p, q = (pose.apply(T, face.where_wide((low + high) / 2)[None])[0] for face, T in ((a, T_a), (b, T_b)))
    tilts = np.zeros((0, 3)) if "rim" in (a.kind, b.kind) else across
    spans = [abs(float(np.subtract(*face.radii))) for face in (a, b) if face.kind == "cone"]
    common = (high - low) / min(spans) if len(spans) == 2 else float(high >= low - _SAME_M)
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([*(rows @ (p - q)), *(tilts @ u)]),
        slope=np.array([*_offsets(rows, p), *_tilts(tilts, u)]),
        lengths=3,
        gap_m=float(np.linalg.norm(rows @ (p - q))),
        angle_rad=measure_angle(u, w),
        share=max(0.0, common),
        half_m=((low + high) / 2,) * len(tilts),
    )


def _offsets(rows: Array, p: Array) -> Array:
    """Derivatives, (r, 6), of how far a point of the first solid is off along directions, (r, 3)."""
    return np.hstack([rows, np.cross(p, rows)])


def _tilts(rows: Array, u: Array) -> Array:
    """Derivatives, (r, 6), of the parts of an axis of the first solid along directions, (r, 3)."""
    return np.hstack([np.zeros((len(rows), 3)), np.cross(u, rows)])
