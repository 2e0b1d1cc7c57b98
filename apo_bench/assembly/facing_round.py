"""Pairs of faces of which at least one is round: how far off, how far askew, how much of each other they hold.

What is measured of a pair are as many numbers as its contact has equations (`apo_bench.assembly.lowering`), lengths
first: how far off an axis is, across the other one or in front of a plane, then how far a cone is from its seat; then
tilts. A turn about the axis changes none of them, so it does not matter how a part of revolution was seen turned.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.kinds import ContactKind, contact_kind, geometric_play
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import face_shape, plane_frame
from apo_bench.geometry.round_face import WHOLE_TURN, RoundFace
from apo_bench.geometry.solid import Face, Solid

_TIGHTEST_M, _LOOSEST_M = -0.1e-3, 0.6e-3
"""A hole whose radius is less larger than that of a shaft, or more, is not the one that the shaft is for."""
_RISING = 1e-9


class RoundMeasure(NamedTuple):
    """What is between two faces of which one is round."""

    residual: Array
    """(r,): lengths, [m], then tilts, [rad] while small."""
    slope: Array
    """(r, 6): its derivative by a twist (v, w) of the first solid in the world, about the origin, the other at rest."""
    lengths: int
    """How many of the residuals are lengths."""
    gap_m: float
    """How far walls are from where they should be; of a shaft on a plane above 0 apart, below 0 inside each other."""
    angle_rad: float
    """Between the axes, or between an axis and a plane."""
    share: float
    """What is common of their lengths over the shorter one; of cones that of their radii."""
    half_m: tuple[float, ...]
    """Half the length that holds each tilt."""


def round_pairs(a: Solid, b: Solid) -> Iterator[tuple[Face | RoundFace, Face | RoundFace]]:
    """The faces of two solids, at least one of them round, whose kinds and sizes can make a contact."""
    return iter(_fitting(a, b))


@lru_cache(maxsize=1024)
def _fitting(a: Solid, b: Solid) -> tuple[tuple[Face | RoundFace, Face | RoundFace], ...]:
    found: list[tuple[Face | RoundFace, Face | RoundFace]] = []
    for one in (*a.faces.values(), *a.rounds.values()):
        for other in (*b.faces.values(), *b.rounds.values()):
            kind = contact_kind(one, other)
            if kind not in (None, "plane on plane") and _TIGHTEST_M <= geometric_play(one, other) <= _LOOSEST_M:
                found.append((one, other))
    return tuple(found)


def measure_round(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> RoundMeasure:
    """Measure two posed faces that can make a contact, of which at least one is round."""
    if isinstance(a, Face):
        assert isinstance(b, RoundFace)
        return _plane_on_shaft(a, T_a, b, T_b)
    if isinstance(b, Face):
        return _shaft_on_plane(a, T_a, b, T_b)
    return _coaxial(a, T_a, b, T_b, contact_kind(a, b))


def _shaft_on_plane(shaft: RoundFace, T_shaft: Array, flat: Face, T_flat: Array) -> RoundMeasure:
    n, u = T_flat[:3, :3] @ flat.normal, T_shaft[:3, :3] @ shaft.axis
    line = _Line.of(shaft, T_shaft, flat, T_flat, n)
    height = float((line.middle - pose.apply(T_flat, flat.outline[:1])[0]) @ n - shaft.radius)
    slope = np.array([[*n, *np.cross(line.middle, n)], [0.0, 0.0, 0.0, *np.cross(u, n)]])
    return line.measured(height, float(n @ u), slope)


def _plane_on_shaft(flat: Face, T_flat: Array, shaft: RoundFace, T_shaft: Array) -> RoundMeasure:
    n, u = T_flat[:3, :3] @ flat.normal, T_shaft[:3, :3] @ shaft.axis
    line = _Line.of(shaft, T_shaft, flat, T_flat, n)
    height = float((line.middle - pose.apply(T_flat, flat.outline[:1])[0]) @ n - shaft.radius)
    slope = np.array([[*-n, *-np.cross(line.middle, n)], [0.0, 0.0, 0.0, *np.cross(n, u)]])
    return line.measured(height, float(n @ u), slope)


class _Line(NamedTuple):
    """Where a shaft lies over a flat face."""

    middle: Array
    """The middle of that piece of its axis, of the whole axis if there is none, (3,), world, [m]."""
    length_m: float
    share: float

    @classmethod
    def of(cls, shaft: RoundFace, T_shaft: Array, flat: Face, T_flat: Array, n: Array) -> _Line:
        from shapely import LineString

        ends, axis = pose.apply(T_shaft, shaft.ends), T_shaft[:3, :3] @ shaft.axis
        frame = plane_frame(flat)
        on = pose.apply(pose.inverse(T_flat @ frame), ends)[:, :2]
        if not _is_round_below(shaft, T_shaft, n) or np.linalg.norm(on[1] - on[0]) < 1e-3 * shaft.length:
            return cls(ends.mean(axis=0), 0.0, 0.0)
        common = LineString(on).intersection(face_shape(flat, pose.inverse(frame)))
        if common.is_empty or not common.length:
            return cls(ends.mean(axis=0), 0.0, 0.0)
        at = np.array(common.centroid.coords[0]) - on[0]
        way = on[1] - on[0]
        middle = ends[0] + float(at @ way / (way @ way)) * (ends[1] - ends[0])
        whole = min(shaft.length, float(np.ptp(flat.outline @ (T_flat[:3, :3].T @ axis))))
        return cls(middle, float(common.length), float(common.length) / whole)

    def measured(self, height_m: float, tilt: float, slope: Array) -> RoundMeasure:
        residual, angle = np.array([height_m, tilt]), float(abs(np.arcsin(np.clip(tilt, -1.0, 1.0))))
        return RoundMeasure(residual, slope, 1, height_m, angle, self.share, (self.length_m / 2,))


def _is_round_below(shaft: RoundFace, T: Array, n: Array) -> bool:
    """Whether a shaft is round where it would lie on a plane that looks along n."""
    if shaft.toward is None or shaft.extent_rad >= WHOLE_TURN:
        return True
    axis, toward = T[:3, :3] @ shaft.axis, T[:3, :3] @ shaft.toward
    below = -(n - (n @ axis) * axis)
    return bool(below @ toward >= np.cos(shaft.extent_rad / 2) * np.linalg.norm(below) - 1e-9)


def _coaxial(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array, kind: ContactKind | None) -> RoundMeasure:
    """A shaft in a hole, in either order: cylinders, cones, or a cone on a rim."""
    u, w, x, y = _wider(a, T_a), _wider(b, T_b), T_b[:3, :3] @ b.frame[:3, 0], T_b[:3, :3] @ b.frame[:3, 1]
    if kind == "shaft in hole" and u @ w < 0.0:
        u = -u
    p, q, share, half = _seat(a, T_a, b, T_b, kind)
    across, tilts = np.array([x, y]), np.array([x, y])
    rows, residual = [[*e, *np.cross(p, e)] for e in across], list(across @ (p - q))
    if kind != "shaft in hole":
        cone = a if a.kind == "cone" else b
        e = w * abs(cone.slope) / np.hypot(1.0, cone.slope)
        rows.append([*e, *np.cross(p, e)])
        residual.append(float(e @ (p - q)))
    lengths = len(residual)
    if kind != "cone on rim":
        rows += [[0.0, 0.0, 0.0, *np.cross(u, e)] for e in tilts]
        residual += list(tilts @ u)
    angle = float(np.arctan2(np.linalg.norm(np.cross(u, w)), u @ w))
    gap = float(np.linalg.norm(residual[:lengths]))
    halves = (half,) * (len(residual) - lengths)
    return RoundMeasure(np.array(residual), np.array(rows), lengths, gap, angle, share, halves)


def _seat(
    a: RoundFace, T_a: Array, b: RoundFace, T_b: Array, kind: ContactKind | None
) -> tuple[Array, Array, float, float]:
    """A point of the first axis and where it should be, (3,) each, world; the common share; half what holds a tilt."""
    if kind == "shaft in hole":
        ends, at, axis = pose.apply(T_a, a.ends), pose.apply(T_b, b.ends), T_b[:3, :3] @ b.axis
        reach = [np.sort((points - at[0]) @ axis) for points in (ends, at)]
        low, high = max(reach[0][0], reach[1][0]), min(reach[0][1], reach[1][1])
        q = at[0] + (low + high) / 2 * axis
        along = T_a[:3, :3] @ a.axis
        p = ends[0] + (q - ends[0]) @ along * along
        return p, q, max(0.0, high - low) / min(a.length, b.length), max(0.0, high - low) / 2
    if kind == "cone on rim":
        rim, cone = (a, b) if a.kind == "rim" else (b, a)
        share = float(min(cone.radii) - _RISING <= rim.radius <= max(cone.radii) + _RISING)
        radius = rim.radius
    else:
        low, high = max(min(a.radii), min(b.radii)), min(max(a.radii), max(b.radii))
        share = max(0.0, high - low) / min(abs(np.subtract(*a.radii)), abs(np.subtract(*b.radii)))
        radius = (low + high) / 2
    p, q = (pose.apply(T, _where(face, radius)[None])[0] for face, T in ((a, T_a), (b, T_b)))
    return p, q, float(share), radius


def _where(face: RoundFace, radius: float) -> Array:
    """The point of the axis where a cone has a radius; the middle of a rim."""
    if face.kind == "rim":
        return np.asarray(face.middle)
    return np.asarray(face.point + (face.span[0] + (radius - face.radii[0]) / face.slope) * face.axis)


def _wider(face: RoundFace, T: Array) -> Array:
    """The axis, world; of a cone, or of what sits on a rim, towards where it is wider."""
    sign = float(np.sign(face.slope)) if face.kind == "cone" else 1.0
    return np.asarray((-sign if face.kind == "rim" and not face.hole else sign) * (T[:3, :3] @ face.axis))
