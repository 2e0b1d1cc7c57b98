"""Parts and faces around a motion: slide directions, slow stretches, hole entrances, later walls, neighbours."""

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactMeasurements,
    Poses,
    find_touched_contacts,
    list_outline_points,
    measure_entrance_depth,
)
from apo_bench.geometry import Array, Face, measure_extent
from apo_bench.planning.insertion.arrival import Arrival

_SLOW_M = 0.003
"""Least length of the slow stretch before the goal."""
_STRAIGHT = 1e-9
"""A slide goes straight at its face if the cosine to the normal is below this - 1."""
WALL_MARGIN_M = 0.002
"""A motion is slow from this far before the walls of an insertion begin."""
OVER_M = 0.02
"""Gap between carried parts and the parts below them."""


def list_slide_directions(assembly: Assembly, arrival: Arrival, poses: Poses) -> tuple[Array, ...]:
    """The level directions of `slide-to-contact`, (3,) each, world frame, towards the faces at their assumed poses.

    Args:
        poses: Of every part, as assumed by the robot; they may differ from those of the arrival.
    """
    sides: list[Array] = []
    for macro in arrival.macros:
        if macro.name == "slide-to-contact":
            first = arrival.touched[macro.makes[0]]
            side = -_touched_normal(assembly, arrival, macro.makes[0], poses)
            # A slanted slide keeps the planned direction in the frame of the part.
            if first.normal @ macro.direction > -1.0 + _STRAIGHT:
                side = poses[arrival.main][:3, :3] @ arrival.to_part_frame(macro.direction)
            if abs(side[2]) < 0.5:
                sides.append(side)
    return tuple(sides)


def _touched_normal(assembly: Assembly, arrival: Arrival, i: int, poses: Poses) -> Array:
    """The normal of touched contact i, (3,), world frame, at the assumed poses."""
    contact, resting_part = arrival.touched[i].contact, arrival.touched[i].rests
    # A round contact has several normals: the position of contact i among those.
    position = sum(each.contact == contact for each in arrival.touched[:i])
    moved = [face.part for face in contact if face.part != resting_part]
    return find_touched_contacts(assembly, [contact], moved, poses)[position].normal


def _list_insertion_walls(arrival: Arrival) -> tuple[Contact, ...]:
    """The contacts between which the part is inserted."""
    return tuple(contact for macro in arrival.macros if macro.inserts for contact in arrival.contacts(macro))


def measure_slow_stretch(assembly: Assembly, arrival: Arrival, poses: Poses, way: Array) -> float:
    """Distance before the goal at which a motion from above becomes slow, [m].

    That is just before the walls of an insertion begin, else `_SLOW_M` above the floor.

    Args:
        way: Unit vector of the motion, (3,), world frame.
    """
    depth = _SLOW_M
    for contact in _list_insertion_walls(arrival):
        depth = max(depth, _measure_overlap_length(assembly, contact, poses, way) + WALL_MARGIN_M)
    return depth


def _measure_overlap_length(assembly: Assembly, contact: Contact, poses: Poses, way: Array) -> float:
    """Length along `way` over which both faces of a contact overlap, [m]; 0 if they do not."""
    if assembly.is_round(contact):
        ends = [list_outline_points(assembly, of, poses) @ way for of in contact]
        return max(0.0, float(min(end.max() for end in ends) - max(end.min() for end in ends)))
    corners = ContactMeasurements(assembly).measure_overlaps([(contact, poses)])[0].corners
    return float(np.ptp(corners @ way)) if len(corners) else 0.0


def list_entrance_distances(assembly: Assembly, arrival: Arrival, poses: Poses, way: Array) -> tuple[float, ...]:
    """Distances before the goal at which walls of the insertion begin, [m], the largest first.

    Args:
        way: Unit vector of the motion towards the goal, (3,), world frame.
    """
    return tuple(
        sorted(
            {measure_entrance_depth(assembly, *contact, poses, way) for contact in _list_insertion_walls(arrival)},
            reverse=True,
        )
    )


def list_later_walls(assembly: Assembly, k: int, part: str) -> list[Array]:
    """Normals, (3,) each, of the faces of a part that later operations bring into contact.

    Operations after the part itself is moved again do not count. A round face gives two directions across its axis.

    Args:
        k: The operation after which to look, counted from 0.
    """
    walls = list[Array]()
    for later, operation in enumerate(assembly.operations[k + 1 :], start=k + 1):
        if operation.main == part:
            break
        walls += list_walls_of_operation(assembly, later, part)
    return walls


def list_walls_of_operation(assembly: Assembly, k: int, part: str) -> list[Array]:
    """Normals, (3,) each, of the faces of a part that have contacts in operation k; a round face gives two."""
    faces = [assembly.face_of(of) for contact in assembly.operations[k].contacts for of in contact if of.part == part]
    # frame[:3, :2]: two directions across the axis of a round face.
    return [n for face in faces for n in ([face.normal] if isinstance(face, Face) else face.frame[:3, :2].T)]


def list_neighbours(contacts: tuple[Contact, ...], moved: tuple[str, ...]) -> set[str]:
    """Parts with a contact in `contacts`, without the moved ones."""
    return {of.part for contact in contacts for of in contact} - set(moved)


def measure_clearing_heights(assembly: Assembly, moved: tuple[str, ...], poses: Poses) -> tuple[float, float]:
    """Height of the top of all resting parts (0 if lower), and of the bottom of the moved parts, [m]."""
    ends = {
        # Lowest and highest z of the part in the world; row 2 of the rotation is the vertical in its frame.
        part: np.add(measure_extent(solid.pieces, poses[part][2, :3]), poses[part][2, 3]).tolist()
        for part, solid in assembly.solids.items()
    }
    top = max((high for part, (_, high) in ends.items() if part not in moved), default=0.0)  # 0: height of the table
    return top, min(ends[part][0] for part in moved)
