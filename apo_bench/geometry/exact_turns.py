"""Symmetries of a solid with any pieces and faces: candidate rotations from corresponding marks on its faces.

Marks are points such as centres and corners of faces, which a symmetry maps onto marks of the same kind. Two marks that
are not collinear with the centre of volume determine a rotation. So every pair of marks to which they could be mapped
gives one candidate. Candidates that map all faces onto like faces, and pieces into pieces, are kept.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face, Piece, Solid

_SAME_M = 1e-6
"""Points closer than this are equal, [m]."""
_COARSE = 1.0 / np.cos(np.pi / 16) - 1.0
"""Tolerance for corners of the polygons that stand for round walls, as a fraction of the radius: at least sixteen
sides."""
_APART = 1e-2
"""Least sine of the angle between two marks, seen from the centre of volume, that determine a rotation."""


class _Marks(NamedTuple):
    """Points on the faces of a solid, relative to its centre of volume, with a kind; a symmetry keeps the kind."""

    points: Array
    """(k, 3), [m]."""
    tags: NDArray[np.intp]
    """(k,), number of the kind of each."""


def exact_turns(solid: Solid) -> Array:
    """The displacements that map a solid onto itself, (m, 4, 4), the identity first; not for parts of revolution."""
    marks = _marks(solid)
    turns = [np.eye(3)]
    for R in _candidates(marks):
        new = all(np.abs(R - known).max() > 1e-6 for known in turns)
        if new and _carries(marks, R) and fills_the_same(solid, centred_turn(solid, R), _doubt(solid)):
            turns.append(R)
    return np.array([centred_turn(solid, R) for R in turns])


def carries_faces(solid: Solid, g: Array) -> bool:
    """Whether a displacement, (4, 4), maps faces onto like faces, and pieces into pieces."""
    about = centred_turn(solid, g[:3, :3])  # a symmetry keeps the centre of volume, so g must equal this
    return bool(
        np.abs(g - about).max() < _SAME_M
        and _carries(_marks(solid), g[:3, :3])
        and fills_the_same(solid, g, _doubt(solid))
    )


def fills_the_same(solid: Solid, g: Array, within_m: float) -> bool:
    """Whether a displacement, (4, 4), maps sample points of all pieces into the union of pieces, up to a distance.

    The volumes are equal, so no part of the union stays empty.

    Args:
        within_m: How far outside the union a point may lie, [m].
    """
    points = pose.apply(g, np.concatenate([_points(piece) for piece in solid.pieces]))
    deepest = np.full(len(points), -np.inf)
    for piece in solid.pieces:
        left = deepest < -within_m
        if not left.any():
            return True
        deepest[left] = np.maximum(deepest[left], measure_depth_inside(piece, points[left]))
    return bool((deepest >= -within_m).all())


def _points(piece: Piece) -> Array:
    """Sample points of a piece, (k, 3), [m]: its corners, their mean, and points in between."""
    corners = piece.corners
    middle = corners.mean(axis=0)
    return np.concatenate([corners, middle + 0.9 * (corners - middle), middle + 0.5 * (corners - middle), middle[None]])


def measure_depth_inside(piece: Piece, points: Array) -> Array:
    """The depth of points, (k, 3), inside a convex piece, (k,), [m]; negative outside."""
    if isinstance(piece, Hull):
        planes = piece.planes
        return np.asarray((planes[:, 3] - points @ planes[:, :3].T).min(axis=1))
    return np.asarray((piece.half - np.abs(points - piece.center)).min(axis=1))


def _doubt(solid: Solid) -> float:
    """How far the flat sides of pieces may be from the round walls that they stand for, [m]."""
    return _SAME_M + _COARSE * max((max(face.radii) for face in solid.rounds.values()), default=0.0)


def centred_turn(solid: Solid, R: Array) -> Array:
    """The rotation R about the centre of volume c as a displacement, (4, 4): x -> R x + (c - R c)."""
    return pose.rigid(R, solid.centroid - R @ solid.centroid)


def _marks(solid: Solid) -> _Marks:
    """The marks of a solid: centres and corners of flat faces, a point above each centre, and ends of round faces.

    Corners on round walls are left out, since polygons stand for them. A round face that is only an arc has a mark at
    its middle too. Kinds count the type of face, fit and sizes, not names. Rims are left out, since other faces end in
    them.
    """
    points = list[Array]()
    tags = list[tuple[object, ...]]()
    rounds = [wall for wall in solid.rounds.values() if wall.kind != "rim"]
    for flat in solid.faces.values():
        corners = np.concatenate([flat.outline, *flat.holes])
        corners = corners[~_on_walls(rounds, corners)]
        middle = _middle(flat)
        for kind, own in (("middle", [middle]), ("above", [middle + 0.01 * flat.normal]), ("corner", list(corners))):
            points += own
            # A point above the face, on its outside, tells a face from one that points the other way.
            tags += [("flat", kind, flat.fit, len(corners))] * len(own)
    for wall in rounds:
        for end, radius, other in zip(wall.ends, wall.radii, wall.radii[::-1], strict=True):
            points.append(end)
            tags.append((wall.kind, wall.hole, wall.fit, *map(_key, (radius, other, wall.length, wall.extent_rad))))
        if wall.toward is not None:
            points.append(wall.middle + wall.radius * wall.toward)
            tags.append(("toward", wall.kind, wall.hole, _key(wall.radius)))
    known = {tag: i for i, tag in enumerate(dict.fromkeys(tags))}
    at = np.array(points).reshape(-1, 3) - solid.centroid
    return _Marks(at, np.array([known[tag] for tag in tags], dtype=np.intp))


def _key(length: float) -> int:
    """A length as an integer, [um].

    The shift by 0.25 makes multiples of half a micrometre, which are common, all round the same way.
    """
    return round(length * 1e6 + 0.25)


def _middle(face: Face) -> Array:
    """The centroid of a flat face without its holes, (3,), [m]."""
    whole = 0.0
    moment = np.zeros(3)
    origin = face.outline[0]
    for loop in (face.outline, *face.holes):
        # Triangles from the origin to each edge: twice their signed area, and their centres (a + b) / 3.
        a = loop - origin
        b = np.concatenate([a[1:], a[:1]])
        twice = np.cross(a, b) @ face.normal
        whole = whole + twice.sum()
        moment = moment + ((a + b) * twice[:, None]).sum(axis=0)
    return np.asarray(origin + moment / (3.0 * whole))


def _on_walls(rounds: list[RoundFace], corners: Array) -> NDArray[np.bool_]:
    """Which corners, (k, 3), belong to a polygon that stands for a round wall, (k,)."""
    on_wall = np.zeros(len(corners), dtype=np.bool_)
    for wall in rounds:
        along = (corners - wall.point) @ wall.axis
        radius = np.interp(along, wall.span, wall.radii)
        far = np.linalg.norm(np.cross(corners - wall.point, wall.axis), axis=1)
        within = (along > wall.span[0] - _SAME_M) & (along < wall.span[1] + _SAME_M)
        on_wall |= within & (np.abs(far - radius) <= _SAME_M + _COARSE * radius)
    return on_wall


def _candidates(marks: _Marks) -> list[Array]:
    """Rotations, (3, 3), that map two of the rarest marks onto marks of the same kinds and distances.

    Empty if no two marks determine a rotation.
    """
    far = np.linalg.norm(marks.points, axis=1)
    rare = np.bincount(marks.tags)[marks.tags]
    # Rarest kinds first, since they give the fewest candidates; marks at the centre of volume say nothing.
    order = [int(i) for i in np.lexsort((np.arange(len(far)), rare)) if far[i] > 1e3 * _SAME_M]
    if not order:
        return []
    first = order[0]
    p = marks.points[first]
    second = next((i for i in order if _sine(p, marks.points[i]) > _APART), None)
    if second is None:
        return []
    q = marks.points[second]
    turns = list[Array]()
    # R = F(a, b) F(p, q)^t takes the frame of two marks to that of two others that are as far from each other.
    base = _frame(p, q)
    for a in marks.points[_like(marks, far, first)]:
        for b in marks.points[_like(marks, far, second)]:
            if abs(a @ b - p @ q) < _SAME_M * (far[first] + far[second]):
                turns.append(_frame(a, b) @ base.T)
    return turns


def _like(marks: _Marks, far: Array, i: int) -> NDArray[np.bool_]:
    """Which marks have the kind of mark i and its distance from the centre of volume (`far`), (k,)."""
    return np.asarray((marks.tags == marks.tags[i]) & (np.abs(far - far[i]) < _SAME_M))


def _sine(p: Array, q: Array) -> float:
    """The sine of the angle between two vectors, (3,)."""
    return float(np.linalg.norm(np.cross(p, q)) / (np.linalg.norm(p) * np.linalg.norm(q)))


def _frame(p: Array, q: Array) -> Array:
    """The rotation with its x axis along p, z along p x q."""
    x = p / np.linalg.norm(p)
    z = np.cross(p, q)
    z = z / np.linalg.norm(z)
    return np.column_stack([x, np.cross(z, x), z])


def _carries(marks: _Marks, R: Array) -> bool:
    """Whether a rotation maps every mark onto a mark of the same kind, and every mark is reached."""
    apart = np.linalg.norm((marks.points @ R.T)[:, None] - marks.points[None], axis=-1)
    near = (apart < 10 * _SAME_M) & (marks.tags[:, None] == marks.tags[None])
    return bool(near.any(axis=1).all() and near.any(axis=0).all())
