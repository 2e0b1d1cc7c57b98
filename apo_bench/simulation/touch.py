"""What a part touches when it is moved: at its side, below it, later; what that asks of the motion."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from apo_bench.assembly import Assembly, Contact
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import overlap
from apo_bench.geometry.solid import Solid, extent
from apo_bench.program import Poses

SLOW_M = 0.003
WALL_MARGIN_M = 0.002
OVER_M = 0.02
"""Room between what is carried and what it is carried over."""


def restored(assembly: Assembly, k: int) -> tuple[Contact, ...]:
    """The contacts that operation k broke: undoing it makes them again."""
    return tuple(contact for contact, made, lost in assembly.relations() if lost == k and made < k)


def held_by(assembly: Assembly, was: int | None, moved: tuple[str, ...]) -> int | None:
    """The operation `was`, out of whose contacts a part must be brought; None if all of them move along."""
    if was is None or all(contact.environment.part in moved for contact in assembly.operations[was].contacts):
        return None
    return was


def sides_of(
    assembly: Assembly, contacts: Iterable[Contact], moved: tuple[str, ...], poses: Poses
) -> tuple[Array, ...]:
    """The level directions in which what moves comes to lie against what rests, fits left out, none twice."""
    sides: list[Array] = []
    for contact in contacts:
        rests = [of for of in contact if of.part not in moved]
        if len(rests) == 1 and not assembly.is_fit(contact):
            side = -poses[rests[0].part][:3, :3] @ assembly.face(rests[0]).normal
            if abs(side[2]) < 0.5 and not any(side @ other > 0.99 for other in sides):
                sides.append(side)
    return tuple(sides)


def slow_before(assembly: Assembly, contacts: tuple[Contact, ...], poses: Poses, way: Array) -> float:
    """How far before the goal a motion from above turns slow: where the first wall begins, or just above the floor."""
    depth = SLOW_M
    for contact in contacts:
        m, e = contact
        wall = assembly.face(e)
        if assembly.is_fit(contact) and abs(poses[e.part][:3, :3] @ wall.normal @ way) < 0.5:
            corners = overlap(assembly.face(m), poses[m.part], wall, poses[e.part]).corners
            if len(corners):
                depth = max(depth, float(np.ptp(corners @ way)) + WALL_MARGIN_M)
    return depth


def later_walls(assembly: Assembly, k: int, part: str) -> list[Array]:
    """Normals of the part's faces, (3,) each, that later operations fit or slide something against.

    Only those before the part is moved by itself again.
    """
    walls = []
    for operation in assembly.operations[k + 1 :]:
        if operation.main == part:
            break
        for contact in operation.contacts:
            walls += [assembly.face(of).normal for of in contact if of.part == part]
    return walls


def neighbours(contacts: tuple[Contact, ...], moved: tuple[str, ...]) -> set[str]:
    """What the moved part touches."""
    return {of.part for contact in contacts for of in contact} - set(moved)


def ends_of(assembly: Assembly, moved: tuple[str, ...], poses: Poses) -> tuple[float, float]:
    """The top of what stands, and the bottom of what moves, [m]."""
    ends = {part: _heights(solid, poses[part]) for part, solid in assembly.solids.items()}
    top = max((high for part, (_, high) in ends.items() if part not in moved), default=0.0)
    return top, min(ends[part][0] for part in moved)


def _heights(solid: Solid, T: Array) -> tuple[float, float]:
    """The lowest and the highest point of a part, [m]."""
    low, high = extent(solid.boxes, T[2, :3])
    return float(T[2, 3] + low), float(T[2, 3] + high)
