"""The contacts of what moves with what rests, as normals and corners in space."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import overlap


class TouchedContact(NamedTuple):
    """A contact, seen from the part that moves."""

    contact: Contact
    rests: str
    """The part that rests."""
    normal: Array
    """From the resting face into the free side, unit length, (3,), world."""


def touched_contacts(
    assembly: Assembly, contacts: Iterable[Contact], moves: Iterable[str], poses: Poses
) -> list[TouchedContact]:
    """The contacts between a part that moves and a part that rests."""
    moving, found = set(moves), []
    for contact in contacts:
        rests = [of for of in contact if of.part not in moving]
        if len(rests) == 1:
            n = poses[rests[0].part][:3, :3] @ assembly.face(rests[0]).normal
            found.append(TouchedContact(contact, rests[0].part, n))
    return found


def corners(assembly: Assembly, touched: Iterable[TouchedContact], poses: Poses) -> tuple[Array, Array]:
    """The corners of the overlaps, (k, 3), world, [m], and the normal at each, (k, 3)."""
    points, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for (m, e), _, n in touched:
        at = overlap(assembly.face(m), poses[m.part], assembly.face(e), poses[e.part]).corners
        points.append(at)
        normals.append(np.tile(n, (len(at), 1)))
    return np.concatenate(points), np.concatenate(normals)
