"""What a part touches when it is moved: at its side, below it, later; what that asks of the motion."""

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    Meetings,
    Poses,
    find_touched_contacts,
    list_outline_points,
    measure_entrance_depth,
)
from apo_bench.geometry import Array, Face, measure_extent
from apo_bench.planning.insertion.arrival import Arrival

_SLOW_M = 0.003
_STRAIGHT = 1e-9
WALL_MARGIN_M = 0.002
OVER_M = 0.02
"""Room between what is carried and what it is carried over."""


def slide_directions(assembly: Assembly, arrival: Arrival, poses: Poses) -> tuple[Array, ...]:
    """The level directions of `slide-to-contact`, (3,) each, world, towards the faces where they are assumed to be."""
    sides: list[Array] = []
    for macro in arrival.macros:
        if macro.name == "slide-to-contact":
            first = arrival.touched[macro.makes[0]]
            side = -_now(assembly, arrival, macro.makes[0], poses)
            if first.normal @ macro.direction > -1.0 + _STRAIGHT:
                side = poses[arrival.main][:3, :3] @ arrival.own(macro.direction)
            if abs(side[2]) < 0.5:
                sides.append(side)
    return tuple(sides)


def _now(assembly: Assembly, arrival: Arrival, i: int, poses: Poses) -> Array:
    """A normal of what is touched, (3,), world, where the parts are assumed to be."""
    contact = arrival.touched[i].contact
    rests = arrival.touched[i].rests
    place = sum(each.contact == contact for each in arrival.touched[:i])
    return find_touched_contacts(assembly, [contact], [of.part for of in contact if of.part != rests], poses)[
        place
    ].normal


def _walls(arrival: Arrival) -> tuple[Contact, ...]:
    """The contacts between which the part is inserted."""
    return tuple(contact for macro in arrival.macros if macro.inserts for contact in arrival.contacts(macro))


def slow_before(assembly: Assembly, arrival: Arrival, poses: Poses, way: Array) -> float:
    """How far before the goal a motion from above turns slow: where an insertion begins, or just above the floor."""
    depth = _SLOW_M
    for contact in _walls(arrival):
        depth = max(depth, _reach(assembly, contact, poses, way) + WALL_MARGIN_M)
    return depth


def _reach(assembly: Assembly, contact: Contact, poses: Poses, way: Array) -> float:
    """How much of a way the faces of a contact have in common, [m]; 0 if nothing."""
    if assembly.is_round(contact):
        ends = [list_outline_points(assembly, of, poses) @ way for of in contact]
        return max(0.0, float(min(end.max() for end in ends) - max(end.min() for end in ends)))
    corners = Meetings(assembly).measure_overlaps([(contact, poses)])[0].corners
    return float(np.ptp(corners @ way)) if len(corners) else 0.0


def mouths(assembly: Assembly, arrival: Arrival, poses: Poses, way: Array) -> tuple[float, ...]:
    """How far before the goal the part comes to where walls begin that it goes between, [m], the first one first."""
    return tuple(
        sorted({measure_entrance_depth(assembly, *contact, poses, way) for contact in _walls(arrival)}, reverse=True)
    )


def later_walls(assembly: Assembly, k: int, part: str) -> list[Array]:
    """Normals of the part's faces, (3,) each, that later operations fit or slide something against.

    Of a round face two directions across its axis. Only those before the part is moved by itself again.
    """
    walls = list[Array]()
    for later, operation in enumerate(assembly.operations[k + 1 :], start=k + 1):
        if operation.main == part:
            break
        walls += own_walls(assembly, later, part)
    return walls


def own_walls(assembly: Assembly, k: int, part: str) -> list[Array]:
    """Normals of a part's faces, (3,) each, that touch something in an operation; of a round face two directions."""
    faces = [assembly.face_of(of) for contact in assembly.operations[k].contacts for of in contact if of.part == part]
    return [n for face in faces for n in ([face.normal] if isinstance(face, Face) else face.frame[:3, :2].T)]


def neighbours(contacts: tuple[Contact, ...], moved: tuple[str, ...]) -> set[str]:
    """What the moved part touches."""
    return {of.part for contact in contacts for of in contact} - set(moved)


def ends_of(assembly: Assembly, moved: tuple[str, ...], poses: Poses) -> tuple[float, float]:
    """The top of what stands, and the bottom of what moves, [m]."""
    ends = {
        part: np.add(measure_extent(solid.pieces, poses[part][2, :3]), poses[part][2, 3]).tolist()
        for part, solid in assembly.solids.items()
    }
    top = max((high for part, (_, high) in ends.items() if part not in moved), default=0.0)
    return top, min(ends[part][0] for part in moved)
