"""How two posed faces of which one is round lie to each other: shaft in hole, shaft on plane, cone in cone or on a rim.

All that asks whether such a contact is closed asks this: the judge, the checks of a scenario, recognition, predictions.
"""

import math
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.covering import NO_OVERLAP, Overlap, flatten_face, make_plane_frame
from apo_bench.geometry.round_face import WHOLE_TURN, RoundFace
from apo_bench.geometry.solid import Face

_EDGE_ON = 1e-6
"""Cosine between two axes, or sine between an axis and the normal of a plane, below which nothing is covered."""
_RIM_M = 1e-3
"""The circle of a rim counts as a strip of this width."""


@final
@dataclass(frozen=True, eq=False)
class Mate:
    """What is between two faces, measured at the two ends of their common length, or at the middle of a rim."""

    points: Array
    """Where it is measured, on the axis of the first face that has one, (k, 3), world, [m]."""
    off: Array
    """From where these points should be to where they are, (k, 3), world, [m]: across the axis of the second face, or
    along the normal of the flat one, out of it where the shaft is above it."""
    axis: Array
    """Of the second face, if that is round, else of the first; unit vector, (3,), world; of a cone or a rim towards
    where it, or what it takes, is wider."""
    angle_rad: float
    """Between the two axes; between the axis of a shaft and the plane."""
    rise_m: float
    """Of a cone: how far the shaft would still have to go into the hole, along the axis, until it sits; 0 of others."""
    sine: float
    """Of the angle between the wall of that cone and its axis: walls are `rise_m * sine` apart."""
    common: Overlap
    """The common length, as the piece of wall around it, unrolled: `share` compares places along the second face. Of
    a shaft on a plane, the shadow of the shaft over the line of contact."""
    length_m: float
    """How long the line of contact is, or how far the shaft is in the hole, along the axis; 0 of a rim."""

    @property
    def gap_m(self) -> float:
        """How far the walls are from where they should be, anywhere on the common length, [m]."""
        return float(max(np.sqrt((self.off * self.off).sum(axis=1)).max(), abs(self.rise_m) * self.sine))


def measure_mate(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> Mate:
    """Measure two faces that can make a contact, of which at least one is round.

    Args:
        a: A face, in the frame of its solid.
        T_a: World pose of that solid, (4, 4), [m].
        b: The face that it is compared with.
        T_b: World pose of that solid.
    """
    if isinstance(a, Face):
        assert isinstance(b, RoundFace)
        return _on_plane(b, T_b, a, T_a, of_plane=False)
    if isinstance(b, Face):
        return _on_plane(a, T_a, b, T_b, of_plane=True)
    return _on_rim(a, T_a, b, T_b) if "rim" in (a.kind, b.kind) else _coaxial(a, T_a, b, T_b)


def _coaxial(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> Mate:
    """A shaft in a hole, in either order: both cylinders, or both cones."""
    ends = pose.apply(T_a, a.ends)
    origin = pose.apply(T_b, b.point[None])[0]
    u = T_a[:3, :3] @ a.wider
    v = T_b[:3, :3] @ b.wider
    along = T_b[:3, :3] @ b.axis
    # Where the ends of one face are along the axis of the other, and what both spans have in common.
    at = (ends - origin) @ along
    low = max(at.min(), b.span[0])
    high = min(at.max(), b.span[1])
    common = NO_OVERLAP
    points = ends
    if high > low and abs(at[1] - at[0]) > _EDGE_ON * a.length:
        # The ends of the common length, taken back to the axis of the first face.
        points = ends[0] + np.outer((np.array([low, high]) - at[0]) / (at[1] - at[0]), ends[1] - ends[0])
        common = _unroll([(low, high)], b.radius * min(a.extent_rad, b.extent_rad), points)
    rise, sine = _rise(b, T_b, a, T_a) if b.kind == "cone" else (0.0, 0.0)
    angle = measure_angle(u, v) if b.kind == "cone" else _between(u, v)
    length = max(0.0, float(high - low))
    return Mate(points, _across(points - origin, along), v, angle, rise, sine, common, length)


def _on_rim(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> Mate:
    """A cone on the rim of a hole, or the rim of a shaft in a countersink, in either order."""
    (cone, T_cone), (rim, T_rim) = ((a, T_a), (b, T_b)) if b.kind == "rim" else ((b, T_b), (a, T_a))
    u = T_a[:3, :3] @ a.wider
    v = T_b[:3, :3] @ b.wider
    middle = pose.apply(T_rim, rim.middle[None])
    on_cone = pose.apply(T_cone, cone.point[None])
    points = middle if a.kind == "rim" else middle - _across(middle - on_cone, T_cone[:3, :3] @ cone.wider)
    off = _across(middle - on_cone, T_cone[:3, :3] @ cone.wider) * (1.0 if a.kind == "rim" else -1.0)
    rise, sine = _rise(cone, T_cone, rim, T_rim)
    fits = min(cone.radii) - _RIM_M * _EDGE_ON <= rim.radius <= max(cone.radii) + _RIM_M * _EDGE_ON
    over = fits and float(np.linalg.norm(off)) < rim.radius
    common = _unroll([(0.0, _RIM_M)], rim.radius * min(a.extent_rad, b.extent_rad), middle) if over else NO_OVERLAP
    return Mate(points, off, v, measure_angle(u, v), rise, sine, common, 0.0)


def _on_plane(shaft: RoundFace, T_shaft: Array, flat: Face, T_flat: Array, *, of_plane: bool) -> Mate:
    """A shaft on a plane, or a plane on a shaft.

    Args:
        of_plane: Whether places are compared on the plane, else along the shaft.
    """
    ends = pose.apply(T_shaft, shaft.ends)
    n = T_flat[:3, :3] @ flat.normal
    axis = T_shaft[:3, :3] @ shaft.axis
    flat_ends = pose.apply(pose.inverse(T_flat @ make_plane_frame(flat)), ends)[:, :2]
    lines = _lines(flat_ends, flat) if _reaches(shaft, T_shaft, n) else []
    at = np.array(lines).reshape(-1) if lines else np.array([0.0, 1.0])
    points = ends[0] + np.outer([at.min(), at.max()], ends[1] - ends[0])
    heights = (points - pose.apply(T_flat, flat.outline[:1])) @ n - shaft.radius
    common = NO_OVERLAP
    if lines and of_plane:
        common = _shadow(lines, flat_ends, shaft.radius, points)
    elif lines:
        spans = shaft.span[0] + shaft.length * np.array(lines)
        common = _unroll([(low, high) for low, high in spans], 2.0 * shaft.radius, points)
    angle = _between(axis, n)
    length = shaft.length * sum(high - low for low, high in lines)
    return Mate(points, np.outer(heights, n), axis, np.pi / 2 - angle, 0.0, 0.0, common, length)


def _rise(cone: RoundFace, T_cone: Array, other: RoundFace, T_other: Array) -> tuple[float, float]:
    """How far the shaft of a cone and another cone, or a rim, is from its seat, and the sine of the cone."""
    seat = cone.where_wide(other.radius)
    # The cone sits where it is as wide as the other face; how far apart the two are along its axis is the rise.
    between = pose.apply(T_cone, seat[None])[0] - pose.apply(T_other, other.middle[None])[0]
    sign = -1.0 if cone.hole else 1.0
    return float(sign * between @ (T_cone[:3, :3] @ cone.wider)), abs(cone.slope) / float(np.hypot(1.0, cone.slope))


def _across(v: Array, axis: Array) -> Array:
    """What is left of vectors, (*, 3), across an axis."""
    return np.asarray(v - (v @ axis)[..., None] * axis)


def measure_angle(u: Array, v: Array) -> float:
    """The angle between two vectors, (3,), exact also where the cosine is flat, [rad]."""
    return math.atan2(_length_of_cross(u, v), u @ v)


def _between(u: Array, v: Array) -> float:
    """Between two lines, [rad]."""
    return math.atan2(_length_of_cross(u, v), abs(u @ v))


def _length_of_cross(u: Array, v: Array) -> float:
    """|u x v|; `numpy.cross` takes ten times as long for one pair."""
    x, y, z = u.tolist()
    a, b, c = v.tolist()
    return math.hypot(y * c - z * b, z * a - x * c, x * b - y * a)


def _reaches(shaft: RoundFace, T: Array, n: Array) -> bool:
    """Whether a shaft is round where it would lie on a plane that looks along n."""
    if shaft.toward is None or shaft.extent_rad >= WHOLE_TURN:
        return True
    down = _across(-n, T[:3, :3] @ shaft.axis)
    return measure_angle(down, T[:3, :3] @ shaft.toward) <= shaft.extent_rad / 2 + _EDGE_ON


def _lines(ends: Array, flat: Face) -> list[tuple[float, float]]:
    """Where a line, (2, 2), in the frame of a flat face is over it: from and until, as parts of its length."""
    from shapely import LineString

    way = ends[1] - ends[0]
    # A line that stands on the face covers nothing of it.
    if way @ way < _EDGE_ON**2 * 1e-6:
        return []
    covered = LineString(ends).intersection(flatten_face(flat))
    pieces = [
        piece
        for piece in getattr(covered, "geoms", (covered,))
        if piece.geom_type == "LineString" and piece.length > 0.0
    ]
    cut = [np.sort((np.asarray(piece.coords)[[0, -1]] - ends[0]) @ way / (way @ way)) for piece in pieces]
    return [(float(low), float(high)) for low, high in cut if high > low]


def _shadow(lines: list[tuple[float, float]], ends: Array, radius: float, points: Array) -> Overlap:
    """The shadow of a shaft over its lines of contact, in the frame of the flat face."""
    from shapely import LineString, union_all

    cut = [ends[0] + np.outer(line, ends[1] - ends[0]) for line in lines]
    shape = union_all([LineString(piece).buffer(radius, cap_style="flat") for piece in cut])
    return Overlap(points, float(shape.area), shape)


def _unroll(spans: list[tuple[float, float]], width: float, points: Array) -> Overlap:
    """A wall between heights along its axis, (low, high), unrolled to a plane."""
    from shapely import box, union_all

    walls = [box(low, 0.0, high, width) for low, high in spans]
    shape = walls[0] if len(walls) == 1 else union_all(walls)
    return Overlap(points, float(shape.area), shape)
