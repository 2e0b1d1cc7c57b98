"""What the play of parts that fit does to the contact equations: by how much each is off, and which are off together.

Two parts that fit are off by one displacement, uniform within the play along every normal at which they fit: faces
that look opposite ways are off by the same amount. In a round hole it is anywhere in a disc. A part that is carried
inside another one also shifts within their play until it is let go of, so its later contacts are off by where it lay in
its carrier before, and by where it lies then: play adds up along what is carried.
"""

from collections.abc import Mapping
from math import sqrt
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, PartFace, find_contact_pattern
from apo_bench.geometry import Array, copy_frozen, remember

LARGEST_CORRELATED = 300
"""Contacts above which the play of each is taken for its own: a covariance of all of them is a dense matrix."""
_DISC = sqrt(3.0) / 2.0
"""A component of a point that is anywhere in a disc deviates by this part of one that is anywhere in an interval."""
_Loose = Mapping[Contact, float]
"""By how much each contact may be off, as a part of the largest play."""


class _Shift(NamedTuple):
    """One displacement of a part within another one, in the frame of the part; equal ones are the same."""

    part: str
    other: str
    made: int
    """The operation that brought them together."""
    until: int
    """The operation after which it is asked for: that one, or one that carried the part."""


@remember
def count_plays(assembly: Assembly, play_m: float) -> tuple[Array, float]:
    """How many independent plays each contact is off by, (c,), in the order of `relations()`, and how large one is,
    [m].
    """
    shifts, unit_m = _shifts(assembly, play_m)
    return copy_frozen(np.array([sum(float(n @ n) for n in own.values()) for own in shifts])), unit_m


@remember
def fit_covariance(assembly: Assembly, play_m: float) -> Array | None:
    """The covariance of the compact equations that play causes, (3 c, 3 c), [m^2]; None of too many, or without play.

    Only the first row of each contact, its centre, goes with others: what turns parts within their play turns each in
    its own way.
    """
    shifts, _ = _shifts(assembly, play_m)
    count, unit_m = count_plays(assembly, play_m)
    if not count.any() or len(shifts) > LARGEST_CORRELATED:
        return None
    every = {
        shift: 3 * i
        for i, shift in enumerate(dict.fromkeys(shift for shifts_of_contact in shifts for shift in shifts_of_contact))
    }
    by = np.zeros((len(shifts), 3 * len(every)))
    for row, shifts_of_contact in zip(by, shifts, strict=True):
        for shift, n in shifts_of_contact.items():
            row[every[shift] : every[shift] + 3] = n
    each = unit_m**2 / 3.0 * np.diff(find_contact_pattern(assembly).begin)
    by *= np.sqrt(each)[:, None]
    # A uniform displacement of half width u has variance u^2 / 3; rows that a displacement has a part in go together.
    S = np.diag(np.repeat(count * each, 3))
    S[::3, ::3] = by @ by.T
    return copy_frozen(S)


@remember
def _shifts(assembly: Assembly, play_m: float) -> tuple[tuple[dict[_Shift, Array], ...], float]:
    """What each contact is off by, in the order of `relations()`: by how much, (3,), of each displacement.

    A face comes nearer if its part moves along the normal; where a part is thought to be is off by how much it has
    moved within its carrier since. The second number is the unit of displacements, the largest play, [m].
    """
    relations = assembly.relations()
    shifts = []
    unit_m = max((assembly.play(relation.contact, play_m) for relation in relations), default=0.0)
    loose = {relation.contact: _looseness(assembly, relation.contact, play_m, unit_m) for relation in relations}
    for contact, made, _ in relations:
        own = dict[_Shift, Array]()
        if loose[contact]:
            inner, outer = contact if not _ever_carries(assembly, *contact) else contact[::-1]
            own[_Shift(inner.part, outer.part, made, made)] = -loose[contact] * assembly.face(inner).normal
        for face in contact:
            n = assembly.face(face).normal
            for shift, way in _carried_shifts(assembly, face.part, made, loose):
                own[shift] = own.get(shift, np.zeros(3)) + way * (_fitting(assembly, shift, loose) @ n)
        shifts.append(own)
    return tuple(shifts), unit_m


def _ever_carries(assembly: Assembly, a: PartFace, b: PartFace) -> bool:
    """Whether the part of a face ever carries that of another one, which is asked for in its frame then."""
    return any(operation.main == a.part and b.part in operation.carries for operation in assembly.operations)


def _looseness(assembly: Assembly, contact: Contact, play_m: float, unit_m: float) -> float:
    """How far a contact may be off, in units of the largest play."""
    size = assembly.play(contact, play_m) / unit_m if unit_m else 0.0
    return size * _DISC if contact in assembly.origin and not assembly.face(contact.manipulated).opposes else size


def _carried_shifts(assembly: Assembly, part: str, after: int, loose: _Loose) -> list[tuple[_Shift, float]]:
    """The displacements within carriers by which a part is off after an operation: as it lay at first, and then."""
    carried = list[tuple[_Shift, float]]()
    for k in range(after, -1, -1):
        operation = assembly.operations[k]
        if part == operation.main:
            break
        if part in operation.carries:
            made = max((m for m, *_ in _together(assembly, part, operation.main, k, loose)), default=None)
            if made is not None:
                before = _Shift(part, operation.main, made, made)
                carried += [(before, -1.0), (before._replace(until=k), 1.0)]
    return carried


def _together(assembly: Assembly, part: str, other: str, before: int, loose: _Loose) -> list[tuple[int, Array, float]]:
    """The contacts that fit of a part with another one that stand before an operation: who made it, its normal, its
    play in units.
    """
    contacts = []
    for contact, made, lost in assembly.relations():
        faces = {face.part: face for face in contact}
        stands = made < before and (lost is None or lost >= before)
        if stands and faces.keys() == {part, other} and loose[contact]:
            contacts.append((made, assembly.face(faces[part]).normal, loose[contact]))
    return contacts


def _fitting(assembly: Assembly, shift: _Shift, loose: _Loose) -> Array:
    """The projection onto the directions along which a part fits into another one, (3, 3), times its play in units."""
    known = _together(assembly, shift.part, shift.other, shift.made + 1, loose)
    normals = np.array([n for _, n, _ in known])
    return np.asarray(np.linalg.pinv(normals) @ normals) * max(size for _, _, size in known)
