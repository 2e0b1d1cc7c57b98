"""Check that the faces which a file states lie on the pieces of the part."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import (
    SAGITTA_M,
    Array,
    Face,
    Piece,
    RoundFace,
    Solid,
    find_plane_across,
    intersect_rays,
    list_rings,
    make_flat_area,
    measure_depth_inside,
    shrink_pieces,
)
from apo_bench.scenario.parts.stated_properties import twice_area

_IN_PLANE_M = 1e-6
"""Points this near to a plane lie in it."""
_PARALLEL = 1e-7
"""Unit vectors are parallel if their cosine is this near to 1."""
_ROUNDED_M = 1e-6
"""Largest rounding error of coordinates in files."""
_BESIDE_M = SAGITTA_M + _ROUNDED_M
"""Largest distance between a round wall and the sides of its pieces."""
_WRITTEN_M = 1e-8
"""Grid of the corners of computed faces, so that rounding in a file does not make their edges cross."""
_SNAP_M = 1e-9
"""Grid of the union of areas; without a grid, areas with nearly equal corners may get lost."""
_ABOVE_M = 2e-5
"""At this height above a flat face no piece may be."""
_COARSE = 0.09
"""Largest distance of the sides of a wall that no contact uses, in radii: a polygon of eight sides is nearer."""
_TRIED_M = 5e-5
"""Clearance with which receding walls are tested."""
_RAYS = 73
"""Rays around a wall at each height. A prime number, so that they do not all meet corners of the polygon."""
_SHARES = np.array([0.02, 0.25, 0.5, 0.75, 0.98])
"""Heights of the rays, as fractions of the length of a wall."""
_LEAST_WALL = 0.5
"""Least fraction of a round face that must lie on pieces; bores may cross it."""
_NEAR = 0.05
"""Depth of the free space in front of a wall in which no piece may be, in radii."""
_REMEDY = "state the face as the pieces are, or correct the pieces"


@final
class FaceError(InputError):
    """A stated face does not agree with the pieces of its part."""

    def __init__(self, place: object, face: str, reason: str, remedy: str = _REMEDY) -> None:
        super().__init__(place, face, reason, remedy)
        self.face = face
        self.reason = reason
        """What is wrong, without place and remedy."""

    def __str__(self) -> str:
        place, face, reason, remedy = self.args
        return f"{place}, faces, {face}: {reason}; {remedy}."


def check_faces(solid: Solid, path: Path) -> float:
    """Raise a `FaceError` unless every stated face lies on the pieces, with free space in front of it.

    Args:
        path: The file, for messages.

    Returns:
        Largest error of the volume from round walls that are approximated by flat sides, [m^3].
    """
    for flat in solid.faces.values():
        _check_flat(flat, solid.pieces, path)
    return sum(_check_round(wall, solid.pieces, path) for wall in solid.rounds.values())


def _find_near_pieces(pieces: tuple[Piece, ...], corners: Array, margin: float) -> list[Piece]:
    """The pieces whose bounding box meets the bounding box of points (k, 3), enlarged by a margin."""
    low = corners.min(axis=0) - margin
    high = corners.max(axis=0) + margin
    return [p for p in pieces if (p.center - p.half <= high).all() and (p.center + p.half >= low).all()]


def _check_flat(face: Face, pieces: tuple[Piece, ...], place: object) -> None:
    """Raise a `FaceError` unless sides of pieces lie below all of a flat face, and no piece covers it."""
    import shapely

    n = face.normal
    to_plane = find_plane_across(face.normal)
    near = _find_near_pieces(pieces, face.outline, _ABOVE_M)
    stated = make_flat_area(face.outline, face.holes, to_plane)
    below = _list_sides_below(face, near, to_plane)
    bare = stated.difference(shapely.unary_union(below, grid_size=_SNAP_M).buffer(_BESIDE_M))
    if not bare.is_empty:
        at = bare.representative_point()
        x, y, z = 1e3 * (to_plane @ np.array([at.x, at.y]) + (n @ face.outline[0]) * n)
        raise FaceError(place, face.name, f"no side of a piece lies below the face at ({x:.4g}, {y:.4g}, {z:.4g}) mm")
    commons = [common for area in below if (common := stated.intersection(area)).area >= _BESIDE_M**2]
    within = [[at.x, at.y] for at in (common.representative_point() for common in commons)]
    points = np.array(within).reshape(-1, 2) @ to_plane.T + (n @ face.outline[0] + _ABOVE_M) * n
    depths = np.array([measure_depth_inside(piece, points) for piece in near])
    for k in np.flatnonzero((depths > _ROUNDED_M).any(axis=0)):
        x, y, z = 1e3 * points[k]
        piece = near[depths[:, k].argmax()]
        raise FaceError(place, face.name, f"piece '{piece.name}' covers the face at ({x:.4g}, {y:.4g}, {z:.4g}) mm")


def _list_sides_below(face: Face, pieces: Iterable[Piece], to_plane: Array) -> list[Any]:
    """The sides of pieces that lie in the plane of a face and look its way, as shapely areas.

    Args:
        to_plane: (3, 2), two unit vectors in the plane as columns.
    """
    height = face.normal @ face.outline[0]
    return [
        _project_side(piece, side, to_plane)
        for piece in pieces
        for side in piece.planes[np.abs(piece.planes[:, 3] - height) < 2.0 * _IN_PLANE_M]
        if side[:3] @ face.normal > 1.0 - _PARALLEL
    ]


def find_supported_area(face: Face, pieces: tuple[Piece, ...]) -> tuple[Face, float] | None:
    """The part of a flat face that lies on sides of pieces, and its fraction of the area; None if not one area."""
    import shapely

    to_plane = find_plane_across(face.normal)
    stated = shapely.make_valid(make_flat_area(face.outline, face.holes, to_plane))
    lying = stated.intersection(shapely.unary_union(_list_sides_below(face, pieces, to_plane), grid_size=_SNAP_M))
    # Shrinking and growing removes slivers; the sum of the offsets is 0.
    for by in (-_BESIDE_M, 1.5 * _BESIDE_M, -0.5 * _BESIDE_M):
        lying = lying.buffer(by, join_style="mitre")
    lying = shapely.set_precision(shapely.make_valid(lying.simplify(_ROUNDED_M)), _WRITTEN_M)
    if lying.geom_type != "Polygon" or lying.is_empty:
        return None
    off = (face.normal @ face.outline[0]) * face.normal
    rings = [ring @ to_plane.T + off for ring in list_rings(lying)]
    # The outline counter-clockwise as seen from outside, holes clockwise.
    oriented = [
        ring if (twice_area(ring) @ face.normal > 0.0) == (k == 0) else ring[::-1] for k, ring in enumerate(rings)
    ]
    return Face(face.name, oriented[0], tuple(oriented[1:])), float(lying.area / stated.area)


def _project_side(piece: Piece, side: Array, to_plane: Array) -> Any:
    """A side of a piece, a row (4,) of its planes, as a shapely area."""
    from shapely import MultiPoint

    corners = piece.corners
    return MultiPoint(corners[np.abs(corners @ side[:3] - side[3]) < _IN_PLANE_M] @ to_plane).convex_hull


def _check_round(wall: RoundFace, pieces: tuple[Piece, ...], place: object) -> float:
    """Raise a `FaceError` unless pieces lie at the stated radius of a wall, and nothing is in front of it.

    Rays from the axis are intersected with the pieces at several heights.

    Returns:
        Largest volume between the wall and the sides of the pieces, [m^3].
    """
    heights, radii = _sample_wall(wall)
    angle = wall.extent_rad * ((np.arange(_RAYS) + 0.5) / _RAYS - (0.0 if wall.toward is None else 0.5))
    near = _find_near_pieces(pieces, wall.ends, max(wall.radii) * (1.0 + _COARSE) + _ABOVE_M)
    if not near:
        raise FaceError(place, wall.name, "no piece is near the face")
    near_wall = 0
    off = 0.0
    allowed = max(_COARSE * max(wall.radii), _BESIDE_M) if wall.name.startswith("auto_") else _BESIDE_M
    for height, radius in zip(heights, radii, strict=True):
        enter, leave = _intersect_pieces(near, wall.point + height * wall.axis, wall.around(angle))
        sign = 1.0 if wall.hole else -1.0  # the material is outside of a hole, inside of a shaft
        free = sorted((radius - sign * _BESIDE_M, radius - sign * max(_NEAR * radius, 2.0 * _BESIDE_M)))
        into = (np.minimum(leave, free[1]) - np.maximum(enter, free[0]) > _ROUNDED_M).any(axis=0)
        at = (
            np.where(leave > radius, enter, np.inf).min(axis=0)
            if wall.hole
            else (np.where(enter < radius, leave, -np.inf).max(axis=0))
        )
        if into.any():
            true = np.abs(at[into][0])
            where = f"{1e3 * true:.4f} mm from its axis" if np.isfinite(true) else "before it"
            stated = f"{1e3 * radius:.4f} mm is stated, which may differ by 0.005 mm"
            raise FaceError(place, wall.name, f"pieces have a side {where}, {stated}")
        gap = np.maximum(sign * (at - radius), 0.0)
        near_wall += int((gap <= allowed).sum())
        off = max(off, float(gap[gap <= allowed].max(initial=0.0)))
    if near_wall < _LEAST_WALL * _RAYS * len(heights):
        raise FaceError(
            place,
            wall.name,
            f"pieces lie along {near_wall / (_RAYS * len(heights)):.0%} of the wall, within {1e3 * allowed:.3g} mm; "
            f"{_LEAST_WALL:.0%} is needed",
        )
    return off * wall.extent_rad * max(wall.radii) * max(wall.length, 0.0)


def check_receding(solid: Solid, path: Path) -> None:
    """Raise an `InputError` unless round holes that are fit get wider all around with a clearance.

    A piece that touches such a wall only with a corner has no side that recedes.
    """
    walls = [wall for wall in solid.rounds.values() if wall.fit and wall.hole and wall.kind == "cylinder"]
    for wall in walls:
        wider = replace(wall, radii=(wall.radius + _TRIED_M, wall.radius + _TRIED_M))
        try:
            _check_round(wider, shrink_pieces(solid, _TRIED_M), "")
        except InputError as error:
            raise FaceError(
                path,
                wall.name,
                "the wall is fit, and pieces that touch it in a corner only keep it from getting wider by the "
                "clearance",
                "cut what is around it into pieces that have sides on it",
            ) from error


def _sample_wall(wall: RoundFace) -> tuple[Array, Array]:
    """Heights of the rays along the axis of a wall, and its radii there, (k,) each; for a rim just inside the part."""
    if wall.kind == "rim":
        return np.array([wall.span[0] - _ROUNDED_M]), np.array([wall.radius])
    heights = wall.span[0] + wall.length * _SHARES
    return heights, wall.radii[0] + wall.slope * (heights - wall.span[0])


def _intersect_pieces(pieces: list[Piece], origin: Array, out: Array) -> tuple[Array, Array]:
    """Distances at which rays `out` (r, 3) enter and leave each piece, (pieces, r) each; inf and -inf for a miss."""
    enter, leave = np.array([intersect_rays(piece.planes, origin, out) for piece in pieces]).swapaxes(0, 1)
    behind = leave <= 0.0
    return np.where(behind, np.inf, np.maximum(enter, 0.0)), np.where(behind, -np.inf, leave)
