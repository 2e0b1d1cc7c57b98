"""Gap, tilt and overlap of two faces of which at least one is round, as residuals with derivatives.

The residuals of a pair are as many as its contact has equations (`apo_bench.assembly.round_contacts_as_planes`).
Lengths come first: offsets across an axis or from a plane, then the distance of a cone from its seat. Tilts follow. A
turn about the axis changes none of them, so it does not matter at which angle a part of revolution was observed.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import final

import numpy as np

from apo_bench.assembly.contact_kinds import classify_contact, compute_geometric_play
from apo_bench.geometry import Array, Face, RoundFace, Solid, measure_angle, measure_mate, pose

_LEAST_PLAY_M = -0.1e-3
"""Least difference of the radii of a hole and a shaft that can make a contact, [m]; negative: the shaft is thicker."""
_LARGEST_PLAY_M = 0.6e-3
"""Largest difference of the radii of a hole and a shaft that can make a contact, [m]."""
_EQUAL_M = 1e-9
"""Tolerance of equal radii, [m]."""


@final
@dataclass(frozen=True, eq=False)
class FacingPair:
    """Two faces that may be in contact, with residuals and their derivatives; axes of round faces count as normals."""

    a: str
    """The face of the first solid."""
    b: str
    """The face of the second solid."""
    gap_m: float
    """Distance from the plane of a to the middle of the overlap on b: positive apart, negative inside each other. For a
    shaft on a plane the height of the shaft; for other round faces the length of the offset, never negative."""
    angle_rad: float
    """Angle between the normal of a and the opposite of that of b; or between axes, or between an axis and a plane."""
    share: float
    """Area of the overlap over that of the smaller face, 0 to 1. For round faces: common length over the shorter
    length; for cones: common range of radii over the smaller range."""
    residual: Array
    """(r,): lengths, [m], then tilts, [rad] while small. For flat faces: the gap, then the components of the normal of
    a along two axes in the plane of b."""
    slope: Array
    """(r, 6): derivative of `residual` by a twist (v, w) of the first solid, world, about the world origin, with b at
    rest."""
    half_m: tuple[float, ...]
    """For each tilt, the lever arm at which it opens the contact: half the extent of the overlap perpendicular to its
    axis."""
    lengths: int = 1
    """Number of residuals that are lengths; the others are tilts."""


@lru_cache(maxsize=1024)
def find_round_pairs(a: Solid, b: Solid) -> tuple[tuple[Face | RoundFace, Face | RoundFace], ...]:
    """All pairs of faces of two solids, at least one of each round, whose kinds and radii can make a contact."""
    faces_of_solids: list[list[Face | RoundFace]] = [
        [*solid.faces.values(), *solid.rounds.values()] for solid in (a, b)
    ]
    return tuple(
        (face, other)
        for face, other in product(*faces_of_solids)
        if classify_contact(face, other) not in (None, "plane on plane")
        and _LEAST_PLAY_M <= compute_geometric_play(face, other) <= _LARGEST_PLAY_M
    )


def measure_round_pair(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> FacingPair:
    """Measure two posed faces that can make a contact, of which at least one is round."""
    if isinstance(a, Face) or isinstance(b, Face):
        return _measure_shaft_on_plane(a, T_a, b, T_b)
    return (
        _measure_shaft_in_hole(a, T_a, b, T_b)
        if classify_contact(a, b) == "shaft in hole"
        else _measure_cone(a, T_a, b, T_b)
    )


def _measure_shaft_on_plane(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> FacingPair:
    """Measure a shaft on a plane, in either order: the mean height, and the tilt of the axis."""
    (shaft, T_shaft), (flat, T_flat) = ((b, T_b), (a, T_a)) if isinstance(a, Face) else ((a, T_a), (b, T_b))
    assert isinstance(shaft, RoundFace)
    assert isinstance(flat, Face)
    n = T_flat[:3, :3] @ flat.normal
    shaft_axis = T_shaft[:3, :3] @ shaft.axis
    mate = measure_mate(shaft, T_shaft, flat, T_flat)
    center = mate.points.mean(axis=0)
    height = float(mate.offsets.mean(axis=0) @ n)
    # Of an axis through p along u over a plane n: d(n . p) = n . v + (p x n) . w, and d(n . u) = (u x n) . w.
    slope = np.array([[*n, *np.cross(center, n)], [0.0, 0.0, 0.0, *np.cross(shaft_axis, n)]])
    covered_length = min(shaft.length, float(np.ptp(flat.outline @ (T_flat[:3, :3].T @ shaft_axis))))
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([height, n @ shaft_axis]),
        slope=-slope if isinstance(a, Face) else slope,
        lengths=1,
        gap_m=height,
        angle_rad=mate.angle_rad,
        share=mate.length_m / covered_length if covered_length > 0.0 else 0.0,
        half_m=(mate.length_m / 2,),
    )


def _measure_shaft_in_hole(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> FacingPair:
    """Measure a cylinder in a cylinder, in either order: two offsets across the axis of b, and two tilts."""
    mate = measure_mate(a, T_a, b, T_b)
    axis_a = T_a[:3, :3] @ a.axis
    axis_b = T_b[:3, :3] @ b.axis
    axis_a = axis_a if axis_a @ axis_b > 0.0 else -axis_a  # axes of cylinders have no sense
    across = (T_b[:3, :3] @ b.frame[:3, :2]).T
    point = mate.points.mean(axis=0)
    offset = across @ mate.offsets.mean(axis=0)
    half_length = mate.length_m / 2
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([*offset, *(across @ axis_a)]),
        slope=np.array([*_offset_derivatives(across, point), *_tilt_derivatives(across, axis_a)]),
        lengths=2,
        gap_m=float(np.linalg.norm(offset)),
        angle_rad=mate.angle_rad,
        share=mate.length_m / min(a.length, b.length),
        half_m=(half_length, half_length),
    )


def _measure_cone(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> FacingPair:
    """Measure a cone in a cone, or on a rim: two offsets across the axis, the distance from the seat, and tilts.

    The two are compared at the points of their axes where both have the same radius, in the middle of the common range.
    """
    axis_a = T_a[:3, :3] @ a.wider
    axis_b = T_b[:3, :3] @ b.wider
    across = (T_b[:3, :3] @ b.frame[:3, :2]).T
    slope = abs(a.slope if a.kind == "cone" else b.slope)
    rows = np.array([*across, axis_b * slope / np.hypot(1.0, slope)])
    low = max(min(a.radii), min(b.radii))
    high = min(max(a.radii), max(b.radii))
    point_a, point_b = (pose.apply(T, face.where_wide((low + high) / 2)[None])[0] for face, T in ((a, T_a), (b, T_b)))
    tilts = np.zeros((0, 3)) if "rim" in (a.kind, b.kind) else across  # a rim is a circle and may tilt
    radius_ranges = [abs(float(np.subtract(*face.radii))) for face in (a, b) if face.kind == "cone"]
    share = (high - low) / min(radius_ranges) if len(radius_ranges) == 2 else float(high >= low - _EQUAL_M)
    return FacingPair(
        a=a.name,
        b=b.name,
        residual=np.array([*(rows @ (point_a - point_b)), *(tilts @ axis_a)]),
        slope=np.array([*_offset_derivatives(rows, point_a), *_tilt_derivatives(tilts, axis_a)]),
        lengths=3,
        gap_m=float(np.linalg.norm(rows @ (point_a - point_b))),
        angle_rad=measure_angle(axis_a, axis_b),
        share=max(0.0, share),
        half_m=((low + high) / 2,) * len(tilts),
    )


def _offset_derivatives(rows: Array, p: Array) -> Array:
    """Derivatives, (r, 6), of the coordinates of a point p of the first solid along directions, (r, 3)."""
    return np.hstack([rows, np.cross(p, rows)])


def _tilt_derivatives(rows: Array, u: Array) -> Array:
    """Derivatives, (r, 6), of the components of an axis u of the first solid along directions, (r, 3), by its twist."""
    return np.hstack([np.zeros((len(rows), 3)), np.cross(u, rows)])
