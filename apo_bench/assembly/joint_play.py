"""Largest gap of a fit contact when parts use all their play together, as a linear program over small motions.

A fit face that recedes lets a part sink or shift, which may open other contacts by more than they recede themselves.
For example, a slide in a dovetail that lies on a receded floor has more room between its leaning walls. The gap that a
small motion opens is linear in the motion.
"""

from collections.abc import Iterator
from functools import lru_cache
from math import cos, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.contact_kinds import classify_contact, compute_play_mm
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry import (
    Array,
    Face,
    FacePair,
    Overlap,
    RoundFace,
    compute_overlaps,
    find_direction_across,
    measure_mate,
    pose,
)

_WALLS_OF_HOLE = 16
"""Directions in which a hole stops its shaft: a polygon of so many walls, its corners on the circle of play."""
_LEVER_MM = 30.0
"""Lever arm that turns rotations into lengths, so that all unknowns of the linear program have one scale."""
_DIGITS = 6
"""Digits of a play in mm that are kept; further ones are rounding of the linear program."""
_PARALLEL = 1e-9
"""Opening by a motion of size 1, in the units of the rows, up to which the motion counts as parallel to the face."""
_POSE_DIGITS = 9
"""Decimal digits of a pose, [m], that distinguish two layouts in the cache."""

AnyFace = Face | RoundFace


class _TouchPoints(NamedTuple):
    """The points at which one contact touches, in the frame of the part that rests."""

    points: Array
    """Contact points, (k, 3), [m]."""
    normals: Array
    """Unit normal out of the resting face at each point, (k, 3)."""
    limit_mm: float
    """How deep the other face may come at each point: the play."""


def compute_joint_play_mm(
    assembly: Assembly, contact: Contact, made: int, true: Poses, clearance_mm: float
) -> float | None:
    """The largest gap between two fit faces, one of them flat, when the pair of parts uses all its play, [mm].

    The gap is that at a corner of the common area of flat faces, or at an end of a shaft on a plane. All contacts count
    that the same operation makes between the same two parts: none of them may get deeper than its own play.

    Args:
        made: The operation that makes the contact, counted from 0.
        true: The poses when it is made, world frame, [m].

    Returns:
        None if the gap is unbounded, there is no other contact, the faces do not fit, or the two parts touch at cones.
        None also for shafts in holes, which are bounded by their own play.
    """
    moved, rests = (end.part for end in contact)
    contacts_of_pair = [
        relation.contact
        for relation in assembly.relations()
        if relation.made == made and {end.part for end in relation.contact} == {moved, rests}
    ]
    if len(contacts_of_pair) < 2 or not assembly.is_fit(contact):
        return None
    # The moved part first in each pair, whichever was manipulated.
    pairs = [each if each.manipulated.part == moved else Contact(*each[::-1]) for each in contacts_of_pair]
    T = np.round(pose.inverse(true[rests]) @ true[moved], _POSE_DIGITS) + 0.0
    faces = tuple((assembly.face_of(moved_face), assembly.face_of(resting_face)) for moved_face, resting_face in pairs)
    return _measure_largest_opening(faces, contacts_of_pair.index(contact), T.tobytes(), clearance_mm)


def compute_deep_limit_mm(
    assembly: Assembly, contact: Contact, clearance_mm: float, margin_mm: float, touching_mm: float
) -> float:
    """How deep faces may be in each other, [mm].

    Args:
        margin_mm: Allowed beyond the play of faces that go into one another.
        touching_mm: Allowed for faces that only touch.
    """
    a, b = map(assembly.face_of, contact)
    play = compute_play_mm(a, b, clearance_mm)
    return touching_mm if play is None else play + margin_mm


def compute_apart_limit_mm(
    assembly: Assembly,
    contact: Contact,
    made: int,
    true: Poses,
    clearance_mm: float,
    margin_mm: float,
    touching_mm: float,
) -> float:
    """How far apart faces may be, [mm]: the larger one of `compute_deep_limit_mm` and the joint play plus a margin.

    Args:
        made, true: As in `compute_joint_play_mm`.
        margin_mm: Allowed beyond the play.
        touching_mm: Allowed for faces that only touch.
    """
    deep = compute_deep_limit_mm(assembly, contact, clearance_mm, margin_mm, touching_mm)
    play = compute_joint_play_mm(assembly, contact, made, true, clearance_mm)
    return deep if play is None else max(deep, play + margin_mm)


@lru_cache(maxsize=1024)
def _measure_largest_opening(
    faces: tuple[tuple[AnyFace, AnyFace], ...], which: int, at: bytes, clearance_mm: float
) -> float | None:
    """The largest gap of one pair of faces, [mm]; None as in `compute_joint_play_mm`.

    Results are cached, since all trials of a seed share the true poses.

    Args:
        faces: All pairs of faces, each that of the moved part first.
        which: The number of the pair asked for.
        at: Pose of the moved part in the frame of the resting one, (4, 4), as bytes, so that it can be a key.
    """
    if not {classify_contact(*pair) for pair in faces} <= {"plane on plane", "shaft in hole", "shaft on plane"}:
        return None
    if classify_contact(*faces[which]) == "shaft in hole":
        return None
    rows, limits, owners = _list_constraint_rows(faces, at, clearance_mm)
    widest = _maximise_opening(rows[owners == which], rows, limits)
    return round(widest, _DIGITS) if np.isfinite(widest) else None


@lru_cache(maxsize=64)
def _list_constraint_rows(
    faces: tuple[tuple[AnyFace, AnyFace], ...], at: bytes, clearance_mm: float
) -> tuple[Array, Array, NDArray[np.intp]]:
    """All contact points as rows of the linear program.

    Returns:
        By how much motions (v [mm], w [mm at the lever]) open the contact at each point, (k, 6); how deep each point
        may come, (k,), [mm]; the number of the pair that each belongs to, (k,).
    """
    T = np.frombuffer(at).reshape(4, 4)
    flat = [FacePair(a, T, b, np.eye(4)) for a, b in faces if isinstance(a, Face) and isinstance(b, Face)]
    common = iter(compute_overlaps(flat))
    touches = [_find_touch_points(a, b, T, clearance_mm, common) for a, b in faces]
    owners = np.repeat(np.arange(len(touches)), [len(touch.points) for touch in touches])
    points = np.concatenate([touch.points for touch in touches])
    normals = np.concatenate([touch.normals for touch in touches])
    # A small motion moves point p by v + w x p, of which n . (v + w x p) = n . v + (p x n) . w opens the contact.
    rows = np.concatenate([normals, np.cross(1e3 * points, normals) / _LEVER_MM], axis=1)
    return rows, np.array([touch.limit_mm for touch in touches])[owners], owners


def _maximise_opening(objective: Array, rows: Array, limits: Array) -> float:
    """The most that a motion opens one of its own rows if no row closes by more than its limit, [mm]; inf if unbounded.

    All own rows share one linear program, each with its own motion, since a call takes longer than what it solves. Two
    cases need no program: a shift along a normal is unbounded, or it opens as much as an opposite row allows at most.

    Args:
        objective: Rows of the pair asked for, (k, 6).
        rows: Rows of all pairs, (m, 6).
        limits: How far each row may close, (m,), [mm].
    """
    from scipy.optimize import linprog

    if not len(objective):
        return np.inf
    # A shift along the normal of each own row goes on until the first row is at its limit.
    rates = -rows[:, :3] @ objective[:, :3].T
    shift = np.where(rates > _PARALLEL, limits[:, None] / np.maximum(rates, _PARALLEL), np.inf).min(axis=0).max()
    # Upper bound: no motion opens an own row by more than the limit of a row that is its opposite.
    faced = (np.abs(rows[:, None] + objective) < _PARALLEL).all(axis=2)
    if shift >= np.where(faced, limits[:, None], np.inf).min(axis=0).max():
        return float(shift)
    # maximise sum_k own_k x_k, with one motion x_k per own row, so that -rows x_k <= limits for each k: the programs
    # have nothing in common, so the matrix of all constraints is block diagonal.
    together = np.kron(np.eye(len(objective)), -rows)
    optimum = linprog(
        -objective.ravel(), together, np.tile(limits, len(objective)), bounds=[(None, None)] * objective.size
    )
    return float((objective * optimum.x.reshape(objective.shape)).sum(axis=1).max()) if optimum.success else np.inf


def _find_touch_points(
    moved: AnyFace, rests: AnyFace, T: Array, clearance_mm: float, overlap: Iterator[Overlap]
) -> _TouchPoints:
    """The contact points of two faces.

    Args:
        moved: The face of the part that moves.
        rests: The face of the part that rests.
        T: The pose of the part that moves in the frame of the one that rests, (4, 4), [m].
        overlap: Yields the overlap of the next pair of flat faces; advanced only if both faces are flat.
    """
    fit_mm = clearance_mm * (moved.fit or rests.fit)
    if isinstance(moved, Face) and isinstance(rests, Face):
        points = next(overlap).corners
        return _TouchPoints(points, np.tile(rests.normal, (len(points), 1)), fit_mm)
    between = measure_mate(moved, T, rests, np.eye(4))
    if isinstance(rests, Face):
        return _TouchPoints(between.points, np.tile(rests.normal, (2, 1)), fit_mm)
    if isinstance(moved, Face):
        return _TouchPoints(between.points, np.tile(-T[:3, :3] @ moved.normal, (2, 1)), fit_mm)
    across = find_direction_across(between.axis)
    angles = 2.0 * np.pi * (np.arange(_WALLS_OF_HOLE) + 0.5) / _WALLS_OF_HOLE
    ring = np.outer(np.cos(angles), across) + np.outer(np.sin(angles), np.cross(between.axis, across))
    play = compute_play_mm(moved, rests, clearance_mm) or 0.0
    ends = between.points
    # Walls at r cos(pi / N) from the axis make a polygon whose corners lie on the circle of radius r.
    return _TouchPoints(
        np.repeat(ends, _WALLS_OF_HOLE, axis=0),
        np.tile(ring, (len(ends), 1)),
        max(0.0, play) * cos(pi / _WALLS_OF_HOLE),
    )
