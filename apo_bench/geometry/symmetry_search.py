"""Symmetries of a solid with any pieces and faces: candidate rotations from corresponding feature points.

Feature points are points such as centres and corners of faces, which a symmetry maps onto feature points of the same
kind. Two points that are not collinear with the centre of volume determine a rotation. So every pair of points to
which they could be mapped gives one candidate. Candidates that map all faces onto like faces, and pieces into pieces,
are kept.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face, Piece, Solid

_EQUAL_M = 1e-6
"""Points closer than this are equal, [m]."""
_POLYGON_ERROR = 1.0 / np.cos(np.pi / 16) - 1.0
"""Tolerance for corners of the polygons that stand for round walls, as a fraction of the radius: at least sixteen
sides."""
_LEAST_SINE = 1e-2
"""Least sine of the angle between two feature points, seen from the centre of volume, that determine a rotation."""


class _FeaturePoints(NamedTuple):
    """Points on the faces of a solid, relative to its centre of volume, with a kind; a symmetry keeps the kind."""

    points: Array
    """(k, 3), [m]."""
    kinds: NDArray[np.intp]
    """(k,), number of the kind of each."""


def find_exact_symmetries(solid: Solid) -> Array:
    """The displacements that map a solid onto itself, (m, 4, 4), the identity first; not for parts of revolution."""
    features = _list_feature_points(solid)
    rotations = [np.eye(3)]
    symmetries = [np.eye(4)]
    for R in _candidate_rotations(features):
        symmetry = make_rotation_about_centroid(solid, R)
        is_new = all(np.abs(R - known).max() > 1e-6 for known in rotations)
        if is_new and _maps_onto_itself(features, R) and covers_same_volume(solid, symmetry, _polygon_tolerance(solid)):
            rotations.append(R)
            symmetries.append(symmetry)
    return np.array(symmetries)


def is_symmetry(solid: Solid, g: Array) -> bool:
    """Whether a displacement, (4, 4), maps faces onto like faces, and pieces into pieces."""
    rotation = make_rotation_about_centroid(solid, g[:3, :3])  # a symmetry keeps the centre, so g must equal this
    return bool(
        np.abs(g - rotation).max() < _EQUAL_M
        and _maps_onto_itself(_list_feature_points(solid), g[:3, :3])
        and covers_same_volume(solid, g, _polygon_tolerance(solid))
    )


def covers_same_volume(solid: Solid, g: Array, tolerance_m: float) -> bool:
    """Whether a displacement, (4, 4), maps sample points of all pieces into the union of pieces, up to a distance.

    The volumes are equal, so no part of the union stays empty.

    Args:
        tolerance_m: How far outside the union a point may lie, [m].
    """
    points = pose.apply(g, np.concatenate([_sample_points(piece) for piece in solid.pieces]))
    depths = np.full(len(points), -np.inf)
    for piece in solid.pieces:
        outside = depths < -tolerance_m
        if not outside.any():
            return True
        depths[outside] = np.maximum(depths[outside], measure_depth_inside(piece, points[outside]))
    return bool((depths >= -tolerance_m).all())


def _sample_points(piece: Piece) -> Array:
    """Sample points of a piece, (k, 3), [m]: its corners, their mean, and points in between."""
    corners = piece.corners
    center = corners.mean(axis=0)
    return np.concatenate([corners, center + 0.9 * (corners - center), center + 0.5 * (corners - center), center[None]])


def measure_depth_inside(piece: Piece, points: Array) -> Array:
    """The depth of points, (k, 3), inside a convex piece, (k,), [m]; negative outside."""
    if isinstance(piece, Hull):
        planes = piece.planes
        return np.asarray((planes[:, 3] - points @ planes[:, :3].T).min(axis=1))
    return np.asarray((piece.half - np.abs(points - piece.center)).min(axis=1))


def _polygon_tolerance(solid: Solid) -> float:
    """How far the flat sides of pieces may be from the round walls that they stand for, [m]."""
    return _EQUAL_M + _POLYGON_ERROR * max((max(face.radii) for face in solid.rounds.values()), default=0.0)


def make_rotation_about_centroid(solid: Solid, R: Array) -> Array:
    """The rotation R about the centre of volume c as a displacement, (4, 4): x -> R x + (c - R c)."""
    return pose.rigid(R, solid.centroid - R @ solid.centroid)


def _list_feature_points(solid: Solid) -> _FeaturePoints:
    """The feature points of a solid: centres and corners of flat faces, a point above each centre, and ends of round
    faces.

    Corners on round walls are left out, since polygons stand for them. A round face that is only an arc has a point at
    its middle too. Kinds count the type of face, fit and sizes, not names. Rims are left out, since other faces end in
    them.
    """
    points = list[Array]()
    kinds = list[tuple[object, ...]]()
    rounds = [wall for wall in solid.rounds.values() if wall.kind != "rim"]
    for flat in solid.faces.values():
        corners = np.concatenate([flat.outline, *flat.holes])
        corners = corners[~_lie_on_round_walls(rounds, corners)]
        centroid = _face_centroid(flat)
        for kind, group in (
            ("middle", [centroid]),
            ("above", [centroid + 0.01 * flat.normal]),
            ("corner", list(corners)),
        ):
            points += group
            # A point above the face, on its outside, tells a face from one that points the other way.
            kinds += [("flat", kind, flat.fit, len(corners))] * len(group)
    for wall in rounds:
        for end, radius, other in zip(wall.ends, wall.radii, wall.radii[::-1], strict=True):
            points.append(end)
            kinds.append(
                (wall.kind, wall.hole, wall.fit, *map(_round_to_um, (radius, other, wall.length, wall.extent_rad)))
            )
        if wall.toward is not None:
            points.append(wall.middle + wall.radius * wall.toward)
            kinds.append(("toward", wall.kind, wall.hole, _round_to_um(wall.radius)))
    numbers = {tag: i for i, tag in enumerate(dict.fromkeys(kinds))}
    positions = np.array(points).reshape(-1, 3) - solid.centroid
    return _FeaturePoints(positions, np.array([numbers[tag] for tag in kinds], dtype=np.intp))


def _round_to_um(length: float) -> int:
    """A length as an integer, [um].

    The shift by 0.25 makes multiples of half a micrometre, which are common, all round the same way.
    """
    return round(length * 1e6 + 0.25)


def _face_centroid(face: Face) -> Array:
    """The centroid of a flat face without its holes, (3,), [m]."""
    doubled_area = 0.0
    moment = np.zeros(3)
    origin = face.outline[0]
    for ring in (face.outline, *face.holes):
        # Triangles from the origin to each edge: twice their signed area, and their centres (a + b) / 3.
        a = ring - origin
        b = np.concatenate([a[1:], a[:1]])
        doubled_areas = np.cross(a, b) @ face.normal
        doubled_area = doubled_area + doubled_areas.sum()
        moment = moment + ((a + b) * doubled_areas[:, None]).sum(axis=0)
    return np.asarray(origin + moment / (3.0 * doubled_area))


def _lie_on_round_walls(rounds: list[RoundFace], corners: Array) -> NDArray[np.bool_]:
    """Which corners, (k, 3), belong to a polygon that stands for a round wall, (k,)."""
    on_wall = np.zeros(len(corners), dtype=np.bool_)
    for wall in rounds:
        along = (corners - wall.point) @ wall.axis
        radius = np.interp(along, wall.span, wall.radii)
        distance = np.linalg.norm(np.cross(corners - wall.point, wall.axis), axis=1)
        in_span = (along > wall.span[0] - _EQUAL_M) & (along < wall.span[1] + _EQUAL_M)
        on_wall |= in_span & (np.abs(distance - radius) <= _EQUAL_M + _POLYGON_ERROR * radius)
    return on_wall


def _candidate_rotations(features: _FeaturePoints) -> list[Array]:
    """Rotations, (3, 3), that map two of the rarest feature points onto points of the same kinds and distances.

    Empty if no two points determine a rotation.
    """
    distances = np.linalg.norm(features.points, axis=1)
    frequency = np.bincount(features.kinds)[features.kinds]
    # Rarest kinds first, since they give the fewest candidates; points at the centre of volume have no direction.
    order = [int(i) for i in np.lexsort((np.arange(len(distances)), frequency)) if distances[i] > 1e3 * _EQUAL_M]
    if not order:
        return []
    first = order[0]
    p = features.points[first]
    second = next((i for i in order if _sine_of_angle(p, features.points[i]) > _LEAST_SINE), None)
    if second is None:
        return []
    q = features.points[second]
    rotations = list[Array]()
    # R = F(a, b) F(p, q)^t takes the frame of two points to that of two others that are as far from each other.
    frame = _frame_of_directions(p, q)
    for image_p in features.points[_equivalent_points(features, distances, first)]:
        for image_q in features.points[_equivalent_points(features, distances, second)]:
            if abs(image_p @ image_q - p @ q) < _EQUAL_M * (distances[first] + distances[second]):
                rotations.append(_frame_of_directions(image_p, image_q) @ frame.T)
    return rotations


def _equivalent_points(features: _FeaturePoints, distances: Array, i: int) -> NDArray[np.bool_]:
    """Which feature points have the kind of point i and its distance from the centre of volume (`distances`), (k,)."""
    return np.asarray((features.kinds == features.kinds[i]) & (np.abs(distances - distances[i]) < _EQUAL_M))


def _sine_of_angle(p: Array, q: Array) -> float:
    """The sine of the angle between two vectors, (3,)."""
    return float(np.linalg.norm(np.cross(p, q)) / (np.linalg.norm(p) * np.linalg.norm(q)))


def _frame_of_directions(p: Array, q: Array) -> Array:
    """The rotation with its x axis along p, z along p x q."""
    x = p / np.linalg.norm(p)
    z = np.cross(p, q)
    z = z / np.linalg.norm(z)
    return np.column_stack([x, np.cross(z, x), z])


def _maps_onto_itself(features: _FeaturePoints, R: Array) -> bool:
    """Whether a rotation maps every feature point onto one of the same kind, and every point is reached."""
    distances = np.linalg.norm((features.points @ R.T)[:, None] - features.points[None], axis=-1)
    matches = (distances < 10 * _EQUAL_M) & (features.kinds[:, None] == features.kinds[None])
    return bool(matches.any(axis=1).all() and matches.any(axis=0).all())
