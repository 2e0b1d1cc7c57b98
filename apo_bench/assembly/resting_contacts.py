"""The contacts of what moves with what rests, as normals and points in space.

A flat contact has one normal. Round walls have many; a few stand for all of them, which is enough to state where a part
may be shifted: of a shaft in a hole one every 90 degrees around the axis, of a part of a wall those at both ends of its
arc and between them. A cone counts as a shaft in a hole with a bottom: it leaves along the axis.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.contact_kinds import classify_contact
from apo_bench.assembly.meeting import Meetings
from apo_bench.assembly.poses import Poses
from apo_bench.assembly.topology import Assembly, Contact, PartFace
from apo_bench.geometry import (
    WHOLE_TURN,
    Array,
    Face,
    RoundFace,
    find_direction_across,
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


def find_touched_contacts(
    assembly: Assembly, contacts: Iterable[Contact], moves: Iterable[str], poses: Poses
) -> list[TouchedContact]:
    """The contacts between a part that moves and a part that rests, round ones once for each normal."""
    moving = set(moves)
    touches = []
    for contact in contacts:
        rests = [of for of in contact if of.part not in moving]
        if len(rests) == 1:
            touches += list(_touch_normals(assembly, contact, rests[0], poses))
    return touches


def find_touch_points(
    assembly: Assembly, touched: Iterable[TouchedContact], poses: Poses, known: Meetings | None = None
) -> tuple[Array, Array]:
    """The points at which contacts touch, of flat ones the corners of their overlap, (k, 3), world, [m], and the normal
    at each, (k, 3).

    Args:
        known: What is measured already.
    """
    every = list(touched)
    flat = iter(
        (known or Meetings(assembly)).measure_overlaps((each.contact, poses) for each in every if each.points is None)
    )
    points = [next(flat).corners if each.points is None else each.points for each in every]
    normals = [np.tile(each.normal, (len(at), 1)) for each, at in zip(every, points, strict=True)]
    nothing = np.zeros((0, 3))
    return np.concatenate([nothing, *points]), np.concatenate([nothing, *normals])


def list_outline_points(assembly: Assembly, of: PartFace, poses: Poses) -> Array:
    """Points that a face reaches to, (k, 3), world, [m]: its corners, or rings at both ends of a round one."""
    face = assembly.face_of(of)
    T = poses[of.part]
    if isinstance(face, Face):
        return np.asarray(face.outline @ T[:3, :3].T + T[:3, 3])
    ring = face.around(_RING)
    return pose.apply(T, np.concatenate([end + r * ring for end, r in zip(face.ends, face.radii, strict=True)]))


def measure_entrance_depth(assembly: Assembly, moved: PartFace, rests: PartFace, poses: Poses, way: Array) -> float:
    """How far before its place on a way a face comes to where another one begins, [m]."""
    ahead, before = (list_outline_points(assembly, of, poses) @ way for of in (moved, rests))
    return float(ahead.max() - before.min())


def _touch_normals(assembly: Assembly, contact: Contact, rests: PartFace, poses: Poses) -> Iterator[TouchedContact]:
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
    kind = classify_contact(still, moved)
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
        x = find_direction_across(z, np.eye(3)[int(np.round(np.abs(z), 9).argmin())])
        y = np.cross(z, x)
        yield from (x, -x, y, -y)
        return
    x = T[:3, :3] @ face.frame[:3, 0]
    y = T[:3, :3] @ face.frame[:3, 1]
    half = face.extent_rad / 2
    for turn in np.linspace(-half, half, 1 + int(np.ceil(face.extent_rad / _QUARTER - 1e-9))):
        yield np.cos(turn) * x + np.sin(turn) * y
