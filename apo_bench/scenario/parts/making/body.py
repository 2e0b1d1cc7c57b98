"""A body under construction: its convex pieces, faces and exact moments, in [m]; bodies can be moved and joined."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
import shapely

from apo_bench.geometry import (
    WHOLE_TURN,
    Array,
    Face,
    Hull,
    RoundFace,
    list_polygons,
    list_rings,
    make_flat_area,
    straighten,
)
from apo_bench.scenario.parts.making.moments import Moments, sum_moments

_SAME_M = 1e-9
"""Lengths that differ by less are equal."""
_PARALLEL = 1e-12
"""Unit vectors are parallel if their absolute cosine is this near to 1."""
_NARROW_M = 6e-6
"""Narrower areas are slivers between two polygons of one circle, and are dropped."""


@final
@dataclass(frozen=True, eq=False)
class Body:
    """A solid under construction."""

    pieces: tuple[Hull, ...]
    """Convex pieces, without names."""
    flats: tuple[Face, ...]
    """Flat faces; "" is the name of a face without one."""
    rounds: tuple[RoundFace, ...]
    """Round faces."""
    moments: Moments
    """Exact moments, [m]."""

    def moved(self, at_mm: Sequence[float] = (0.0, 0.0, 0.0), turn_deg: Sequence[float] = (0.0, 0.0, 0.0)) -> "Body":
        """The body rotated about the fixed axes x, then y, then z of its frame, then shifted."""
        from scipy.spatial.transform import Rotation

        R = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
        t = 1e-3 * np.asarray(at_mm)
        R = np.where(np.abs(R) < 1e-15, 0.0, R)  # right angles stay exact
        return Body(
            tuple(_move_piece(piece, R, t) for piece in self.pieces),
            tuple(
                replace(f, outline=f.outline @ R.T + t, holes=tuple(hole @ R.T + t for hole in f.holes))
                for f in self.flats
            ),
            tuple(
                replace(f, point=R @ f.point + t, axis=R @ f.axis, toward=None if f.toward is None else R @ f.toward)
                for f in self.rounds
            ),
            self.moments.moved(R, t),
        )

    def with_rim(
        self,
        name: str,
        at_mm: Sequence[float],
        axis: Sequence[float],
        radius_mm: float,
        hole: bool = True,
    ) -> "Body":
        """The body with one more face: the circle (rim) at the end of a hole or a shaft.

        Args:
            at_mm: Centre of the circle, (3,).
            axis: Direction out of the part, (3,), of any length.
            hole: True for the rim of a hole, False for that of a shaft.
        """
        n = np.asarray(axis, dtype=np.float64)
        r = 1e-3 * radius_mm
        rim = RoundFace(name, 1e-3 * np.asarray(at_mm), n / np.linalg.norm(n), (0.0, 0.0), (r, r), hole)
        return replace(self, rounds=(*self.rounds, rim))

    def prefixed(self, prefix: str) -> "Body":
        """The body with a prefix on the names of its faces; faces without a name get none."""
        return replace(
            self,
            flats=tuple(replace(f, name=f.name and prefix + f.name) for f in self.flats),
            rounds=tuple(replace(f, name=f.name and prefix + f.name) for f in self.rounds),
        )


def join(*bodies: Body) -> Body:
    """Join bodies that touch but do not overlap into one.

    Where faces of two bodies lie on each other, the common area is removed; faces of one name in one plane are merged.
    """
    flats = [face for body in bodies for face in body.flats]
    rounds = [face for body in bodies for face in body.rounds]
    return Body(
        tuple(piece for body in bodies for piece in body.pieces),
        tuple(_join_flats(flats)),
        tuple(_join_rounds(rounds)),
        sum_moments(bodies[0].moments, (body.moments for body in bodies[1:])),
    )


def _move_piece(piece: Hull, R: Array, t: Array) -> Hull:
    """The piece after x -> R x + t."""
    cylinder = piece.cylinder
    if cylinder is not None:
        cylinder = cylinder._replace(center=R @ cylinder.center + t, axis=R @ cylinder.axis)
    return Hull(piece.name, piece.corners @ R.T + t, cylinder)


def _join_flats(flats: Sequence[Face]) -> Iterable[Face]:
    """Join flat faces plane by plane.

    In each plane the areas of opposite faces are subtracted from each other, and faces of one name and fit are merged.
    """
    left = list(flats)
    while left:  # each turn takes all faces in one plane n . x = d, of either direction
        n = left[0].normal
        d = float(n @ left[0].outline[0])
        on = [f for f in left if abs(abs(n @ f.normal) - 1.0) < _PARALLEL and abs(n @ f.outline[0] - d) < _SAME_M]
        left = [f for f in left if not any(f is each for each in on)]
        to_plane = _plane_basis(n)
        same = [(f, make_flat_area(f.outline, f.holes, to_plane[:2].T)) for f in on if n @ f.normal > 0.0]
        other = [(f, make_flat_area(f.outline, f.holes, to_plane[:2].T)) for f in on if n @ f.normal < 0.0]
        if not other and len(same) == 1:
            yield same[0][0]
            continue
        for ours, theirs, sign in ((same, other, 1.0), (other, same, -1.0)):
            against = shapely.unary_union([area for _, area in theirs])
            by_name: dict[tuple[str, bool], list[Any]] = {}
            for face, area in ours:
                by_name.setdefault((face.name, face.fit), []).append(area)
            for (name, fit), areas in by_name.items():
                rest = shapely.set_precision(shapely.unary_union(areas), 0.0).difference(against)
                for polygon in _split_at_points(rest):
                    if not polygon.buffer(-_NARROW_M / 2).is_empty:
                        yield _make_face(name, fit, polygon, to_plane, d, sign)


def _split_at_points(area: Any) -> Iterable[Any]:
    """Yield the polygons of an area, split where parts touch in a single point, which no ring may contain twice."""
    for polygon in list_polygons(area):
        parts = [*list_polygons(shapely.set_precision(polygon, _SAME_M))]
        yield from parts if len(parts) > 1 else [polygon]


def _plane_basis(n: Array) -> Array:
    """A rotation (3, 3) whose rows are two unit vectors in the plane with normal n, and n."""
    u = np.eye(3)[(int(np.abs(n).argmax()) + 1) % 3]
    u = u - (u @ n) * n
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(n, u), n])


def _make_face(name: str, fit: bool, polygon: Any, to_plane: Array, d: float, sign: float) -> Face:
    """The face of a polygon in a plane.

    Args:
        to_plane: (3, 3), as from `_plane_basis`.
        d: Distance of the plane from the origin along its normal.
        sign: 1 if the face looks along the normal, -1 if against it.
    """
    flat = [straighten(ring) for ring in list_rings(polygon, sign)]
    outline, *holes = (np.asarray(ring @ to_plane[:2] + d * to_plane[2]) for ring in flat)
    return Face(name, outline, tuple(holes), fit)


def _join_rounds(rounds: Sequence[RoundFace]) -> list[RoundFace]:
    """Merge cylindrical walls of equal radius, name and axis that follow each other."""
    joined: list[RoundFace] = []
    for face in rounds:
        for i, other in enumerate(joined):
            whole = _join_pair(other, face)
            if whole is not None:
                joined[i] = whole
                break
        else:
            joined.append(face)
    return joined


def _join_pair(a: RoundFace, b: RoundFace) -> RoundFace | None:
    """Two consecutive walls as one; None if they are not parts of one cylinder or leave a gap."""
    if a.kind != "cylinder" or b.kind != "cylinder" or (a.hole, a.name, a.fit) != (b.hole, b.name, b.fit):
        return None
    off = b.point - a.point
    along = off @ a.axis
    turned = a.axis @ b.axis
    same = (
        abs(abs(turned) - 1.0) < _PARALLEL
        and np.linalg.norm(off - along * a.axis) < _SAME_M
        and abs(a.radius - b.radius) < _SAME_M
        and abs(a.extent_rad - b.extent_rad) < 1e-9
        and (a.extent_rad > WHOLE_TURN - 1e-9 or bool(np.linalg.norm(_mean_direction(a) - _mean_direction(b)) < 1e-9))
    )
    if not same:
        return None
    # The span of b, in heights along the axis of a.
    spans = sorted([a.span, tuple(sorted(along + np.sign(turned) * np.array(b.span)))])
    if abs(spans[0][1] - spans[1][0]) > _SAME_M:
        return None
    return replace(a, span=(float(spans[0][0]), float(spans[1][1])))


def _mean_direction(face: RoundFace) -> Array:
    """The direction to the middle of a partial wall, (3,); zero for a full turn."""
    return np.zeros(3) if face.toward is None else face.toward
