"""The contacts of what moves with what rests, as normals and points in space.

A flat contact has one normal. Round walls have many; a few stand for all of them, which is enough to say where a part
may be shifted: of a shaft in a hole one every 90 degrees around the axis, of a part of a wall those at both ends of its
arc and between them. A cone counts as a shaft in a hole with a bottom: it leaves along the axis.

Faces of two solids that look at each other: how far apart, how far from parallel, how much they cover each other.
"""

from collections.abc import Collection, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.facing_round import Facing, contact_kind, measure_round, round_pairs
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact, PartFace
from apo_bench.geometry import (
    WHOLE_TURN,
    Array,
    Face,
    RoundFace,
    Solid,
    across_axis,
    balls_apart,
    face_area,
    overlap,
    pose,
)

_QUARTER = np.pi / 2
_RING = 2 * np.pi * np.arange(16) / 16


class TouchedContact(NamedTuple):
    """A contact, or one normal of a round one, seen from the part that moves."""

    contact: Contact
    rests: str
    """The part that rests."""
    normal: Array
    """From the resting face into the free side, unit length, (3,), world."""
    points: Array | None = None
    """Where round faces touch so, (k, 3), world, [m]; None of flat ones, which touch where they overlap."""


def touched_contacts(
    assembly: Assembly, contacts: Iterable[Contact], moves: Iterable[str], poses: Poses
) -> list[TouchedContact]:
    """The contacts between a part that moves and a part that rests, round ones once for each normal."""
    moving = set(moves)
    touches = []
    for contact in contacts:
        rests = [of for of in contact if of.part not in moving]
        if len(rests) == 1:
            touches += list(_touched(assembly, contact, rests[0], poses))
    return touches


def corners(assembly: Assembly, touched: Iterable[TouchedContact], poses: Poses) -> tuple[Array, Array]:
    """The points at which contacts touch, of flat ones the corners of their overlap, (k, 3), world, [m], and the normal
    at each, (k, 3)."""
    points = [np.zeros((0, 3))]
    normals = [np.zeros((0, 3))]
    for (m, e), _, n, at in touched:
        if at is None:
            at = overlap(assembly.face(m), poses[m.part], assembly.face(e), poses[e.part]).corners
        points.append(at)
        normals.append(np.tile(n, (len(at), 1)))
    return np.concatenate(points), np.concatenate(normals)


def outline_points(assembly: Assembly, of: PartFace, poses: Poses) -> Array:
    """Points that a face reaches to, (k, 3), world, [m]: its corners, or rings at both ends of a round one."""
    face = assembly.face_of(of)
    T = poses[of.part]
    if isinstance(face, Face):
        return np.asarray(face.outline @ T[:3, :3].T + T[:3, 3])
    ring = face.around(_RING)
    return pose.apply(T, np.concatenate([end + r * ring for end, r in zip(face.ends, face.radii, strict=True)]))


def mouth(assembly: Assembly, moved: PartFace, rests: PartFace, poses: Poses, way: Array) -> float:
    """How far before its place on a way a face comes to where another one begins, [m]."""
    ahead, before = (outline_points(assembly, of, poses) @ way for of in (moved, rests))
    return float(ahead.max() - before.min())


def _touched(assembly: Assembly, contact: Contact, rests: PartFace, poses: Poses) -> Iterator[TouchedContact]:
    m, e = contact
    other = m if rests == e else e
    still = assembly.face_of(rests)
    moved = assembly.face_of(other)
    T = poses[rests.part]
    T_moved = poses[other.part]
    if isinstance(still, Face) and isinstance(moved, Face):
        yield TouchedContact(contact, rests.part, T[:3, :3] @ still.normal)
    elif isinstance(still, Face):
        assert isinstance(moved, RoundFace)
        n = T[:3, :3] @ still.normal
        yield TouchedContact(contact, rests.part, n, pose.apply(T_moved, moved.ends) - moved.radius * n)
    elif isinstance(moved, Face):
        n = -T_moved[:3, :3] @ moved.normal
        yield TouchedContact(contact, rests.part, n, pose.apply(T, still.ends) + still.radius * n)
    else:
        yield from (TouchedContact(contact, rests.part, n, points) for n, points in _around(still, T, moved, T_moved))


def _around(still: RoundFace, T: Array, moved: RoundFace, T_moved: Array) -> Iterator[tuple[Array, Array]]:
    """The normals of two round faces, and where each acts: off the wall at both ends of what the faces have in common,
    and, where cones meet or a rim, out along the axis."""
    kind = contact_kind(still, moved)
    out = -1.0 if still.hole else 1.0
    axis = T[:3, :3] @ still.axis
    at = pose.apply(T, still.ends)
    if kind == "cone on rim":
        at = at.mean(axis=0)[None] if still.kind == "rim" else pose.apply(T_moved, moved.ends[:1])
    else:
        ends = [np.sort((points - at[0]) @ axis) for points in (at, pose.apply(T_moved, moved.ends))]
        common = np.array([max(ends[0][0], ends[1][0]), min(ends[0][1], ends[1][1])])
        at = at[0] + np.outer(common if common[0] < common[1] else [common.mean()], axis)
    for d in _directions(still, T, moved, T_moved):
        yield out * d, at + (still.radius * d if kind == "shaft in hole" else 0.0)
    if kind != "shaft in hole":
        leaves = 1.0 if still.kind == "rim" else -out * np.sign(still.slope)
        yield leaves * axis, at.mean(axis=0)[None]


def _directions(still: RoundFace, T: Array, moved: RoundFace, T_moved: Array) -> Iterator[Array]:
    """From the axis to the walls, unit vectors, (3,), world: of the shorter arc; of whole turns along the world."""
    face, T = min((still, T), (moved, T_moved), key=lambda each: each[0].extent_rad)
    if face.extent_rad >= WHOLE_TURN - 1e-9:
        z = T[:3, :3] @ face.axis
        x = across_axis(z, np.eye(3)[int(np.round(np.abs(z), 9).argmin())])
        y = np.cross(z, x)
        yield from (x, -x, y, -y)
        return
    x = T[:3, :3] @ face.frame[:3, 0]
    y = T[:3, :3] @ face.frame[:3, 1]
    half = face.extent_rad / 2
    for turn in np.linspace(-half, half, 1 + int(np.ceil(face.extent_rad / _QUARTER - 1e-9))):
        yield np.cos(turn) * x + np.sin(turn) * y


def faces_oppose(a: Face, T_a: Array, b: Face, T_b: Array, angle_rad: float) -> bool:
    """Whether two posed faces look at each other, their normals opposite within an angle."""
    return bool((T_a[:3, :3] @ a.normal) @ (T_b[:3, :3] @ b.normal) < -np.cos(angle_rad))


def height(a: Face, T_a: Array, b: Face, T_b: Array) -> float:
    """How far the middle of face a stands in front of the plane of face b, [m]; below 0 behind it."""
    n = T_b[:3, :3] @ b.normal
    return float((pose.apply(T_a, a.outline).mean(axis=0) - pose.apply(T_b, b.outline[:1])[0]) @ n)


def facing(
    a: Solid,
    T_a: Array,
    b: Solid,
    T_b: Array,
    *,
    gap_m: float,
    angle_rad: float,
    share: float,
    known: Collection[tuple[str, str]] = (),
) -> Iterator[Facing]:
    """All pairs of faces of two posed solids that might touch.

    Args:
        T_a: World pose of the first solid, (4, 4), [m].
        T_b: That of the second one.
        gap_m: Pairs whose planes are farther apart in the middle of the overlap are left out.
        angle_rad: Pairs whose normals are farther from opposite are left out.
        share: Pairs that cover less of the smaller face are left out.
        known: Pairs, by name, that need not be measured again.
    """
    if balls_apart(a.pieces, T_a, b.pieces, T_b) > gap_m:
        return
    posed_a = _posed(a, T_a)
    posed_b = _posed(b, T_b)
    for i, j in np.argwhere(posed_a.normals @ posed_b.normals.T < -np.cos(angle_rad)):
        if (posed_a.faces[i].name, posed_b.faces[j].name) in known:
            continue
        heights = (posed_a.corners[i] - posed_b.corners[j][0]) @ posed_b.normals[j]
        if heights.min() > gap_m or heights.max() < -gap_m:
            continue
        pair = _pair(posed_a, i, T_a, posed_b, j, T_b, share)
        if pair is not None and abs(pair.gap_m) <= gap_m:
            yield pair
    for face, other in round_pairs(a, b):
        if (face.name, other.name) not in known:
            measured = measure_round(face, T_a, other, T_b)
            if abs(measured.gap_m) <= gap_m and measured.angle_rad <= angle_rad and measured.share >= share:
                yield measured


def face_gap(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> float:
    """From the middle of the overlap, on b, to the plane of a, [m]; from the middle of b where nothing overlaps."""
    if isinstance(a, RoundFace) or isinstance(b, RoundFace):
        return measure_round(a, T_a, b, T_b).gap_m
    common = overlap(a, T_a, b, T_b)
    middle = (common.corners if len(common.corners) else pose.apply(T_b, b.outline)).mean(axis=0)
    return float((T_a[:3, :3] @ a.normal) @ (middle - pose.apply(T_a, a.outline[:1])[0]))


class _Posed(NamedTuple):
    """The faces of a solid in the world."""

    faces: tuple[Face, ...]
    normals: Array
    """(f, 3)."""
    corners: list[Array]
    """The corners of each outline, (k, 3), [m]."""


def _posed(solid: Solid, T: Array) -> _Posed:
    faces = tuple(solid.faces.values())
    normals = np.array([face.normal for face in faces]).reshape(-1, 3)
    return _Posed(faces, normals @ T[:3, :3].T, [pose.apply(T, face.outline) for face in faces])


def _pair(a: _Posed, i: int, T_a: Array, b: _Posed, j: int, T_b: Array, share: float) -> Facing | None:
    """What is measured of face i of one solid and face j of another; None if they cover too little of each other."""
    face_a = a.faces[i]
    face_b = b.faces[j]
    n_a = a.normals[i]
    n_b = b.normals[j]
    common = overlap(face_a, T_a, face_b, T_b)
    covered = common.area / min(face_area(face_a), face_area(face_b))
    if covered < share or not len(common.corners):
        return None
    middle = common.corners.mean(axis=0)
    u, v = _axes(n_b, T_b[:3, :3])
    residual = np.array([n_a @ (middle - a.corners[i][0]), u @ n_a, v @ n_a])
    # A twist (v, w) of a about the origin moves its plane along n_a by n_a . v + (p x n_a) . w at p, the middle on b,
    # by which the gap gets smaller, and changes u . n_a by (n_a x u) . w.
    lever, turn_u, turn_v = np.cross(np.array([middle, n_a, n_a]), np.array([n_a, u, v]))
    slope = np.zeros((3, 6))
    slope[0] = [*-n_a, *-lever]
    slope[1, 3:] = turn_u
    slope[2, 3:] = turn_v
    half = np.ptp((common.corners - middle) @ np.array([u, v]).T, axis=0) / 2
    return Facing(
        a=face_a.name,
        b=face_b.name,
        gap_m=float(residual[0]),
        angle_rad=float(np.arctan2(np.hypot(*residual[1:]), -(n_a @ n_b))),
        share=covered,
        residual=residual,
        slope=slope,
        half_m=(float(half[0]), float(half[1])),
    )


def _axes(n: Array, R: Array) -> tuple[Array, Array]:
    """Two unit vectors across n and each other; the first follows the axis of the part that is most across."""
    u = across_axis(n, R[:, int(np.abs(n @ R).argmin())])
    return u, np.array([n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]])
