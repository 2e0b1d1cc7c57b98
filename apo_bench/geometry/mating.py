"""Relative pose of two mating faces of which one is round: shaft in hole, shaft on plane, cone in cone, cone on rim.

The judge, the checks of scenarios, contact detection and failure prediction all use this measurement to decide whether
such a contact is closed.
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
_RIM_WIDTH_M = 1e-3
"""Width of the strip that stands for the circle of a rim, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Mate:
    """The misalignment of two faces, measured at both ends of their common length, or at the middle of a rim."""

    points: Array
    """Where the misalignment is measured, on the axis of the first face that has one, (k, 3), world, [m]."""
    offsets: Array
    """Offset of each point from its ideal position, (k, 3), world, [m]: perpendicular to the axis of the second face,
    or along the normal of the flat face, outwards where the shaft is above it."""
    axis: Array
    """Axis of the second face, or of the first if the second is flat; unit vector, (3,), world. Of a cone or a rim it
    points to where the cone, or the cone that the rim takes, is wider."""
    angle_rad: float
    """Angle between the two axes, or between the axis of a shaft and the plane."""
    rise_m: float
    """For a cone: how far the shaft still has to move into the hole, along the axis, until it is seated; otherwise
    0."""
    sine: float
    """Sine of the half angle of that cone: the distance of the walls is `rise_m * sine`; otherwise 0."""
    common: Overlap
    """The overlap. For coaxial faces it is the wall along the common length, unrolled to a plane: `compute_shares`
    compares intervals along the second face. For a shaft and a plane see `_measure_on_plane`."""
    length_m: float
    """Length of the line of contact of a shaft on a plane, or of the shaft in the hole, along the axis; 0 for a rim."""

    @property
    def gap_m(self) -> float:
        """Largest distance of the walls from their ideal position anywhere on the common length, [m]."""
        return float(max(np.sqrt((self.offsets * self.offsets).sum(axis=1)).max(), abs(self.rise_m) * self.sine))


def measure_mate(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> Mate:
    """Measure two posed faces that can make a contact, of which at least one is round.

    Args:
        a: A face, in the frame of its solid.
        T_a: World pose of that solid, (4, 4), [m].
        b: The face that it is compared with.
        T_b: World pose of that solid, (4, 4), [m].
    """
    if isinstance(a, Face):
        assert isinstance(b, RoundFace)
        return _measure_on_plane(b, T_b, a, T_a, of_plane=False)
    if isinstance(b, Face):
        return _measure_on_plane(a, T_a, b, T_b, of_plane=True)
    return _measure_on_rim(a, T_a, b, T_b) if "rim" in (a.kind, b.kind) else _measure_coaxial(a, T_a, b, T_b)


def _measure_coaxial(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> Mate:
    """Measure a shaft in a hole, in either order: both cylinders, or both cones."""
    ends = pose.apply(T_a, a.ends)
    origin = pose.apply(T_b, b.point[None])[0]
    axis_a = T_a[:3, :3] @ a.wider
    axis_b = T_b[:3, :3] @ b.wider
    direction = T_b[:3, :3] @ b.axis
    # Coordinates of the ends of face a along the axis of face b, and the interval that both spans have in common.
    coordinates = (ends - origin) @ direction
    low = max(coordinates.min(), b.span[0])
    high = min(coordinates.max(), b.span[1])
    overlap = NO_OVERLAP
    points = ends
    if high > low and abs(coordinates[1] - coordinates[0]) > _EDGE_ON * a.length:
        # The ends of the common length, taken back to the axis of the first face.
        points = ends[0] + np.outer(
            (np.array([low, high]) - coordinates[0]) / (coordinates[1] - coordinates[0]), ends[1] - ends[0]
        )
        overlap = _unroll_wall([(low, high)], b.radius * min(a.extent_rad, b.extent_rad), points)
    rise, sine = _measure_rise(b, T_b, a, T_a) if b.kind == "cone" else (0.0, 0.0)
    angle = measure_angle(axis_a, axis_b) if b.kind == "cone" else _angle_between_lines(axis_a, axis_b)
    length = max(0.0, float(high - low))
    return Mate(
        points, _perpendicular_components(points - origin, direction), axis_b, angle, rise, sine, overlap, length
    )


def _measure_on_rim(a: RoundFace, T_a: Array, b: RoundFace, T_b: Array) -> Mate:
    """Measure a cone on the rim of a hole, or the rim of a shaft in a countersink, in either order."""
    (cone, T_cone), (rim, T_rim) = ((a, T_a), (b, T_b)) if b.kind == "rim" else ((b, T_b), (a, T_a))
    axis_a = T_a[:3, :3] @ a.wider
    axis_b = T_b[:3, :3] @ b.wider
    middle = pose.apply(T_rim, rim.middle[None])
    on_cone = pose.apply(T_cone, cone.point[None])
    points = (
        middle if a.kind == "rim" else middle - _perpendicular_components(middle - on_cone, T_cone[:3, :3] @ cone.wider)
    )
    # Offset of a relative to b: that of the rim relative to the cone, or the opposite.
    off = _perpendicular_components(middle - on_cone, T_cone[:3, :3] @ cone.wider) * (1.0 if a.kind == "rim" else -1.0)
    rise, sine = _measure_rise(cone, T_cone, rim, T_rim)
    fits = min(cone.radii) - _RIM_WIDTH_M * _EDGE_ON <= rim.radius <= max(cone.radii) + _RIM_WIDTH_M * _EDGE_ON
    overlaps = fits and float(np.linalg.norm(off)) < rim.radius
    overlap = (
        _unroll_wall([(0.0, _RIM_WIDTH_M)], rim.radius * min(a.extent_rad, b.extent_rad), middle)
        if overlaps
        else NO_OVERLAP
    )
    return Mate(points, off, axis_b, measure_angle(axis_a, axis_b), rise, sine, overlap, 0.0)


def _measure_on_plane(shaft: RoundFace, T_shaft: Array, flat: Face, T_flat: Array, *, of_plane: bool) -> Mate:
    """Measure a shaft on a plane.

    Args:
        of_plane: True: `overlap` is the shadow of the shaft on the plane; False: it is its wall over the line of
            contact, unrolled.
    """
    ends = pose.apply(T_shaft, shaft.ends)
    n = T_flat[:3, :3] @ flat.normal
    axis = T_shaft[:3, :3] @ shaft.axis
    flat_ends = pose.apply(pose.inverse(T_flat @ make_plane_frame(flat)), ends)[:, :2]
    # Intervals of the axis, 0 at its first end and 1 at its last, that lie over the face; the whole axis if none does.
    intervals = _intervals_over_face(flat_ends, flat) if _faces_plane(shaft, T_shaft, n) else []
    fractions = np.array(intervals).reshape(-1) if intervals else np.array([0.0, 1.0])
    points = ends[0] + np.outer([fractions.min(), fractions.max()], ends[1] - ends[0])
    heights = (points - pose.apply(T_flat, flat.outline[:1])) @ n - shaft.radius
    overlap = NO_OVERLAP
    if intervals and of_plane:
        overlap = _project_shaft(intervals, flat_ends, shaft.radius, points)
    elif intervals:
        spans = shaft.span[0] + shaft.length * np.array(intervals)
        overlap = _unroll_wall([(low, high) for low, high in spans], 2.0 * shaft.radius, points)
    angle = _angle_between_lines(axis, n)
    length = shaft.length * sum(high - low for low, high in intervals)
    return Mate(points, np.outer(heights, n), axis, np.pi / 2 - angle, 0.0, 0.0, overlap, length)


def _measure_rise(cone: RoundFace, T_cone: Array, other: RoundFace, T_other: Array) -> tuple[float, float]:
    """How far a shaft must still go into its hole until cone and other face are seated, [m], and the sine of the cone.

    Args:
        cone: The conical wall of the shaft or the hole.
        other: A cone or a rim on the other part.
    """
    seated_center = cone.where_wide(other.radius)
    # The faces are seated where the cone has the radius of the other face: the distance along its axis is the rise.
    offset = pose.apply(T_cone, seated_center[None])[0] - pose.apply(T_other, other.middle[None])[0]
    sign = -1.0 if cone.hole else 1.0
    return float(sign * offset @ (T_cone[:3, :3] @ cone.wider)), abs(cone.slope) / float(np.hypot(1.0, cone.slope))


def _perpendicular_components(v: Array, axis: Array) -> Array:
    """The components of vectors, (*, 3), perpendicular to a unit axis."""
    return np.asarray(v - (v @ axis)[..., None] * axis)


def measure_angle(u: Array, v: Array) -> float:
    """The angle between two vectors, (3,), [rad]; accurate for small angles too, unlike the arc cosine."""
    return math.atan2(_norm_of_cross_product(u, v), u @ v)


def _angle_between_lines(u: Array, v: Array) -> float:
    """The angle between two undirected lines, 0 to pi / 2, [rad]."""
    return math.atan2(_norm_of_cross_product(u, v), abs(u @ v))


def _norm_of_cross_product(u: Array, v: Array) -> float:
    """|u x v| of two vectors, (3,); `numpy.cross` takes ten times as long for one pair."""
    x, y, z = u.tolist()
    a, b, c = v.tolist()
    return math.hypot(y * c - z * b, z * a - x * c, x * b - y * a)


def _faces_plane(shaft: RoundFace, T: Array, n: Array) -> bool:
    """Whether the wall of a shaft, if it is only an arc, faces a plane with normal n.

    Args:
        T: World pose of the solid of the shaft, (4, 4).
        n: Outward normal of the plane, (3,), world.
    """
    if shaft.toward is None or shaft.extent_rad >= WHOLE_TURN:
        return True
    toward_plane = _perpendicular_components(-n, T[:3, :3] @ shaft.axis)
    return measure_angle(toward_plane, T[:3, :3] @ shaft.toward) <= shaft.extent_rad / 2 + _EDGE_ON


def _intervals_over_face(ends: Array, flat: Face) -> list[tuple[float, float]]:
    """Intervals in which a line lies over a flat face, as fractions of its length, (low, high).

    Args:
        ends: Both ends of the line in the plane frame of the face, (2, 2), [m].
    """
    from shapely import LineString

    direction = ends[1] - ends[0]
    # A line perpendicular to the face has no length in its plane.
    if direction @ direction < _EDGE_ON**2 * 1e-6:
        return []
    covered = LineString(ends).intersection(flatten_face(flat))
    pieces = [
        piece
        for piece in getattr(covered, "geoms", (covered,))
        if piece.geom_type == "LineString" and piece.length > 0.0
    ]
    intervals = [
        np.sort((np.asarray(piece.coords)[[0, -1]] - ends[0]) @ direction / (direction @ direction)) for piece in pieces
    ]
    return [(float(low), float(high)) for low, high in intervals if high > low]


def _project_shaft(intervals: list[tuple[float, float]], ends: Array, radius: float, points: Array) -> Overlap:
    """The projection of a shaft onto a flat face along its lines of contact, in the plane frame of the face.

    Args:
        intervals: Intervals of the shaft, as returned by `_intervals_over_face`.
        ends: Both ends of its axis in the plane frame, (2, 2), [m].
        points: The corners of the result, (k, 3), world, [m].
    """
    from shapely import LineString, union_all

    segments = [ends[0] + np.outer(line, ends[1] - ends[0]) for line in intervals]
    shape = union_all([LineString(piece).buffer(radius, cap_style="flat") for piece in segments])
    return Overlap(points, float(shape.area), shape)


def _unroll_wall(spans: list[tuple[float, float]], width: float, points: Array) -> Overlap:
    """A wall over intervals (low, high) along its axis, [m], unrolled to rectangles of the given width in a plane."""
    from shapely import box, union_all

    walls = [box(low, 0.0, high, width) for low, high in spans]
    shape = walls[0] if len(walls) == 1 else union_all(walls)
    return Overlap(points, float(shape.area), shape)
