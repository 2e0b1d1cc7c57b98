"""Candidate contacts of two posed solids: pairs of faces that face each other, with gap, tilt and overlap."""

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.round_face_pairs import FacingPair, find_round_pairs, measure_round_pair
from apo_bench.geometry import (
    Array,
    Face,
    FacePair,
    Overlap,
    RoundFace,
    Solid,
    compute_overlap,
    compute_overlaps,
    find_direction_across,
    measure_ball_distance,
    measure_face_area,
    pose,
)


def faces_oppose(a: Face, T_a: Array, b: Face, T_b: Array, angle_rad: float) -> bool:
    """Whether the normals of two posed faces are opposite within an angle."""
    return bool((T_a[:3, :3] @ a.normal) @ (T_b[:3, :3] @ b.normal) < -np.cos(angle_rad))


def measure_height(a: Face, T_a: Array, b: Face, T_b: Array) -> float:
    """The height of the centre of the corners of face a over the plane of face b, [m]; negative behind it."""
    n = T_b[:3, :3] @ b.normal
    return float((pose.apply(T_a, a.outline).mean(axis=0) - pose.apply(T_b, b.outline[:1])[0]) @ n)


def find_facing_pairs(
    a: Solid,
    T_a: Array,
    b: Solid,
    T_b: Array,
    *,
    gap_m: float,
    angle_rad: float,
    share: float,
    known: Collection[tuple[str, str]] = (),
) -> Iterator[FacingPair]:
    """Yield the pairs of faces of two posed solids that may be in contact.

    Args:
        T_a: World pose of the first solid, (4, 4), [m].
        T_b: World pose of the second one.
        gap_m: Pairs with a larger gap are left out; it is measured at the middle of the overlap.
        angle_rad: Pairs whose normals are farther from opposite are left out.
        share: Pairs that cover less of the smaller face are left out.
        known: Pairs, by name, that need not be measured again.
    """
    if measure_ball_distance(a.pieces, T_a, b.pieces, T_b) > gap_m:
        return
    posed_a = _pose_faces(a, T_a)
    posed_b = _pose_faces(b, T_b)
    candidates = []
    for i, j in np.argwhere(posed_a.normals @ posed_b.normals.T < -np.cos(angle_rad)):
        if (posed_a.faces[i].name, posed_b.faces[j].name) in known:
            continue
        heights = (posed_a.corners[i] - posed_b.corners[j][0]) @ posed_b.normals[j]
        if heights.min() <= gap_m and heights.max() >= -gap_m:
            candidates.append((i, j))
    if candidates:
        overlaps = compute_overlaps([FacePair(posed_a.faces[i], T_a, posed_b.faces[j], T_b) for i, j in candidates])
        for (i, j), overlap in zip(candidates, overlaps, strict=True):
            pair = _measure_flat_pair(posed_a, i, posed_b, j, T_b, overlap, share)
            if pair is not None and abs(pair.gap_m) <= gap_m:
                yield pair
    for face, other in find_round_pairs(a, b):
        if (face.name, other.name) not in known:
            pair_of_round = measure_round_pair(face, T_a, other, T_b)
            if (
                abs(pair_of_round.gap_m) <= gap_m
                and pair_of_round.angle_rad <= angle_rad
                and pair_of_round.share >= share
            ):
                yield pair_of_round


def measure_face_gap(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> float:
    """The distance from the plane of a to the middle of the overlap on b, [m]; to the middle of b if nothing overlaps.

    For round faces it is the gap of `measure_round_pair`.
    """
    if isinstance(a, RoundFace) or isinstance(b, RoundFace):
        return measure_round_pair(a, T_a, b, T_b).gap_m
    overlap = compute_overlap(a, T_a, b, T_b)
    center = (overlap.corners if len(overlap.corners) else pose.apply(T_b, b.outline)).mean(axis=0)
    return float((T_a[:3, :3] @ a.normal) @ (center - pose.apply(T_a, a.outline[:1])[0]))


class _PosedFaces(NamedTuple):
    """The flat faces of a solid in the world."""

    faces: tuple[Face, ...]
    normals: Array
    """Outward unit normals, (f, 3)."""
    corners: list[Array]
    """The corners of each outline, (k, 3), [m]."""


def _pose_faces(solid: Solid, T: Array) -> _PosedFaces:
    """The flat faces of a solid with pose T, (4, 4), in the world."""
    faces = tuple(solid.faces.values())
    normals = np.array([face.normal for face in faces]).reshape(-1, 3)
    return _PosedFaces(faces, normals @ T[:3, :3].T, [pose.apply(T, face.outline) for face in faces])


def _measure_flat_pair(
    a: _PosedFaces, i: int, b: _PosedFaces, j: int, T_b: Array, overlap: Overlap, share: float
) -> FacingPair | None:
    """Measure face i of one solid against face j of another; None if they cover too little of each other.

    Args:
        T_b: World pose of the second solid, (4, 4), [m].
        overlap: The overlap of the two faces.
    """
    face_a = a.faces[i]
    face_b = b.faces[j]
    n_a = a.normals[i]
    n_b = b.normals[j]
    covered_share = overlap.area / min(measure_face_area(face_a), measure_face_area(face_b))
    if covered_share < share or not len(overlap.corners):
        return None
    center = overlap.corners.mean(axis=0)
    u, v = _axes_in_plane(n_b, T_b[:3, :3])
    residual = np.array([n_a @ (center - a.corners[i][0]), u @ n_a, v @ n_a])
    # A twist (v, w) of a about the origin moves its plane along n_a by n_a . v + (p x n_a) . w at p, the middle on b,
    # by which the gap gets smaller, and changes u . n_a by (n_a x u) . w.
    moment_arm, d_tilt_u, d_tilt_v = np.cross(np.array([center, n_a, n_a]), np.array([n_a, u, v]))
    slope = np.zeros((3, 6))
    slope[0] = [*-n_a, *-moment_arm]
    slope[1, 3:] = d_tilt_u
    slope[2, 3:] = d_tilt_v
    half_extent = np.ptp((overlap.corners - center) @ np.array([u, v]).T, axis=0) / 2
    return FacingPair(
        a=face_a.name,
        b=face_b.name,
        gap_m=float(residual[0]),
        angle_rad=float(np.arctan2(np.hypot(*residual[1:]), -(n_a @ n_b))),
        share=covered_share,
        residual=residual,
        slope=slope,
        half_m=(float(half_extent[0]), float(half_extent[1])),
    )


def _axes_in_plane(n: Array, R: Array) -> tuple[Array, Array]:
    """Two unit vectors perpendicular to the unit normal n and to each other; u is derived from a part axis.

    Args:
        R: Orientation of the part, (3, 3); the axis most nearly perpendicular to n gives u.
    """
    u = find_direction_across(n, R[:, int(np.abs(n @ R).argmin())])
    return u, np.array([n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]])
