"""Contacts between moving and resting parts as unit normals and contact points in the world.

A flat contact has one normal. A few normals stand for those of round walls, which is enough to tell in which directions
a part can be shifted. For a shaft in a hole there is one every 90 degrees; for an arc there is one at both ends and
some between. A cone counts as a shaft in a hole with a bottom: it leaves along the axis.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.contact_kinds import classify_contact
from apo_bench.assembly.contact_measurements import ContactMeasurements
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

_QUARTER_TURN = np.pi / 2
"""Largest angle between neighbouring normals of an arc, [rad]."""
_CIRCLE_ANGLES = 2 * np.pi * np.arange(16) / 16
"""Angles of the points that stand for a circle, [rad]."""


class TouchedContact(NamedTuple):
    """A contact with one normal; a round contact gives several."""

    contact: Contact
    rests: str
    """The part that rests."""
    normal: Array
    """From the resting face towards the free side, unit vector, (3,), world."""
    points: Array | None = None
    """Contact points of round faces for this normal, (k, 3), world, [m]; None for flat faces, which touch where they
    overlap."""


def find_touched_contacts(
    assembly: Assembly, contacts: Iterable[Contact], moves: Iterable[str], poses: Poses
) -> list[TouchedContact]:
    """The contacts between a part that moves and a part that rests, one entry per normal.

    Args:
        moves: The parts that move; every other one rests.
        poses: World poses of the parts, [m].
    """
    moving = set(moves)
    touches = []
    for contact in contacts:
        rests = [of for of in contact if of.part not in moving]
        if len(rests) == 1:
            touches += list(_list_normals_of_contact(assembly, contact, rests[0], poses))
    return touches


def find_touch_points(
    assembly: Assembly, touched: Iterable[TouchedContact], poses: Poses, known: ContactMeasurements | None = None
) -> tuple[Array, Array]:
    """The points at which contacts touch, (k, 3), world, [m], and the normal at each, (k, 3).

    For flat contacts these are the corners of the overlap.

    Args:
        known: Measurements to reuse.
    """
    every = list(touched)
    flat = iter(
        (known or ContactMeasurements(assembly)).measure_overlaps(
            (each.contact, poses) for each in every if each.points is None
        )
    )
    points = [next(flat).corners if each.points is None else each.points for each in every]
    normals = [np.tile(each.normal, (len(at), 1)) for each, at in zip(every, points, strict=True)]
    nothing = np.zeros((0, 3))
    return np.concatenate([nothing, *points]), np.concatenate([nothing, *normals])


def list_outline_points(assembly: Assembly, of: PartFace, poses: Poses) -> Array:
    """Points on the outline of a face, (k, 3), world, [m]: its corners, or circles at both ends of a round face."""
    face = assembly.face_of(of)
    T = poses[of.part]
    if isinstance(face, Face):
        return np.asarray(face.outline @ T[:3, :3].T + T[:3, 3])
    ring = face.around(_CIRCLE_ANGLES)
    return pose.apply(T, np.concatenate([end + r * ring for end, r in zip(face.ends, face.radii, strict=True)]))


def measure_entrance_depth(
    assembly: Assembly, moved: PartFace, rests: PartFace, poses: Poses, direction: Array
) -> float:
    """How far the moved face has to go along `direction`, from first contact in that direction to its place, [m].

    It is the greatest coordinate of the moved face minus the least coordinate of the resting one.

    Args:
        direction: The unit vector of the motion, (3,), world.
    """
    distance, before = (list_outline_points(assembly, face, poses) @ direction for face in (moved, rests))
    return float(distance.max() - before.min())


def _list_normals_of_contact(
    assembly: Assembly, contact: Contact, rests: PartFace, poses: Poses
) -> Iterator[TouchedContact]:
    """Yield one entry for each normal of a contact; `rests` is the face of the resting part."""
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
        yield from (
            TouchedContact(contact, rests.part, n, points)
            for n, points in _list_normals_around(still, T, moved, T_moved)
        )


def _list_normals_around(
    resting_face: RoundFace, T: Array, moved: RoundFace, T_moved: Array
) -> Iterator[tuple[Array, Array]]:
    """Yield the normals that stand for a contact of two round faces, and the points at which each acts, world.

    Normals, (3,), point out of the resting wall and act at both ends of the common length, (k, 3), [m]. Cones and rims
    have one more normal, along the axis, in the direction in which the moved part leaves.
    """
    kind = classify_contact(resting_face, moved)
    out = (
        -1.0 if resting_face.hole else 1.0
    )  # the free side of a hole is towards the axis, that of a shaft away from it
    axis = T[:3, :3] @ resting_face.axis
    at = pose.apply(T, resting_face.ends)
    if kind == "cone on rim":
        at = at.mean(axis=0)[None] if resting_face.kind == "rim" else pose.apply(T_moved, moved.ends[:1])
    else:
        ends = [np.sort((points - at[0]) @ axis) for points in (at, pose.apply(T_moved, moved.ends))]
        common = np.array([max(ends[0][0], ends[1][0]), min(ends[0][1], ends[1][1])])
        at = at[0] + np.outer(common if common[0] < common[1] else [common.mean()], axis)
    for direction in _directions_to_wall(resting_face, T, moved, T_moved):
        yield out * direction, at + (resting_face.radius * direction if kind == "shaft in hole" else 0.0)
    if kind != "shaft in hole":
        leaves = 1.0 if resting_face.kind == "rim" else -out * np.sign(resting_face.slope)
        yield leaves * axis, at.mean(axis=0)[None]


def _directions_to_wall(resting_face: RoundFace, T: Array, moved: RoundFace, T_moved: Array) -> Iterator[Array]:
    """Unit vectors from the axis to the wall, (3,), world, on the shorter arc of two round faces.

    If both are whole turns: four directions, 90 degrees apart, aligned with the world, not with the part.
    """
    face, T = min((resting_face, T), (moved, T_moved), key=lambda each: each[0].extent_rad)
    if face.extent_rad >= WHOLE_TURN - 1e-9:
        z = T[:3, :3] @ face.axis
        x = find_direction_across(z, np.eye(3)[int(np.round(np.abs(z), 9).argmin())])
        y = np.cross(z, x)
        yield from (x, -x, y, -y)
        return
    x = T[:3, :3] @ face.frame[:3, 0]
    y = T[:3, :3] @ face.frame[:3, 1]
    half = face.extent_rad / 2
    for turn in np.linspace(-half, half, 1 + int(np.ceil(face.extent_rad / _QUARTER_TURN - 1e-9))):
        yield np.cos(turn) * x + np.sin(turn) * y
