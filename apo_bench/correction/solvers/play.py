"""Covariance of the contact equations from play: how far each may be off, and which are off together.

Two parts that fit are off by one displacement, uniform within the play along every normal at which they fit. So faces
with opposite normals are off by the same amount. In a round hole the displacement is anywhere in a disc. A part that is
carried inside another one also shifts within their play until it is released. Its later contacts are off by its shift
in the carrier before and by its shift then, so play adds up along carried parts.
"""

from collections.abc import Mapping
from math import sqrt
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, PartFace, find_equation_pattern
from apo_bench.geometry import Array, copy_frozen, remember

LARGEST_CORRELATED = 300
"""Number of contacts above which plays count as independent, since their covariance is a dense matrix."""
_DISC = sqrt(3.0) / 2.0
"""Standard deviation of a component uniform in a disc, relative to one that is uniform in an interval."""
_Loose = Mapping[Contact, float]
"""Contact -> how far it may be off, as a fraction of the largest play."""


class _Shift(NamedTuple):
    """Key of one displacement of a part within another one, in the frame of the part."""

    part: str
    other: str
    made: int
    """The operation that brought them together."""
    until: int
    """The last operation at which the displacement is taken: `made`, or an operation that carried the part."""


@remember
def count_plays(assembly: Assembly, play_m: float) -> tuple[Array, float]:
    """The number of independent plays by which each contact is off, (c,), in the order of `relations()`.

    A play counts by its squared size. The second value is the unit, the largest play, [m].
    """
    shifts, unit_m = _shifts(assembly, play_m)
    return copy_frozen(np.array([sum(float(n @ n) for n in own.values()) for own in shifts])), unit_m


@remember
def fit_covariance(assembly: Assembly, play_m: float) -> Array | None:
    """The covariance of the compact equations from play, (3 c, 3 c), [m^2]; None without play or for too many contacts.

    Only the first equation of each contact, that of the centre, is correlated with others: rotations within the play
    are independent.
    """
    shifts, _ = _shifts(assembly, play_m)
    count, unit_m = count_plays(assembly, play_m)
    if not count.any() or len(shifts) > LARGEST_CORRELATED:
        return None
    every = {
        shift: 3 * i
        for i, shift in enumerate(dict.fromkeys(shift for shifts_of_contact in shifts for shift in shifts_of_contact))
    }
    # Derivative of the centre of each contact by each displacement, three components each.
    by = np.zeros((len(shifts), 3 * len(every)))
    for row, shifts_of_contact in zip(by, shifts, strict=True):
        for shift, n in shifts_of_contact.items():
            row[every[shift] : every[shift] + 3] = n
    each = unit_m**2 / 3.0 * np.diff(find_equation_pattern(assembly).begin)
    by *= np.sqrt(each)[:, None]
    # A uniform displacement of half width u has variance u^2 / 3; rows that a displacement has a part in go together.
    S = np.diag(np.repeat(count * each, 3))
    S[::3, ::3] = by @ by.T
    return copy_frozen(S)


@remember
def _shifts(assembly: Assembly, play_m: float) -> tuple[tuple[dict[_Shift, Array], ...], float]:
    """For each contact, in the order of `relations()`, its derivative, (3,), by each displacement that it depends on.

    A contact closes when its part moves along the normal. The assumed pose of a carried part is off by its motion
    within the carrier since. The second value is the unit of displacements, the largest play, [m].
    """
    relations = assembly.relations()
    shifts = []
    unit_m = max((assembly.play(relation.contact, play_m) for relation in relations), default=0.0)
    loose = {relation.contact: _looseness(assembly, relation.contact, play_m, unit_m) for relation in relations}
    for contact, made, _ in relations:
        own = dict[_Shift, Array]()
        if loose[contact]:
            # The displacement is stated in the frame of the part that does not carry the other.
            inner, outer = contact if not _ever_carries(assembly, *contact) else contact[::-1]
            own[_Shift(inner.part, outer.part, made, made)] = -loose[contact] * assembly.face(inner).normal
        for face in contact:
            n = assembly.face(face).normal
            for shift, way in _carried_shifts(assembly, face.part, made, loose):
                own[shift] = own.get(shift, np.zeros(3)) + way * (_fitting(assembly, shift, loose) @ n)
        shifts.append(own)
    return tuple(shifts), unit_m


def _ever_carries(assembly: Assembly, a: PartFace, b: PartFace) -> bool:
    """Whether an operation moves the part of face a and carries the part of face b."""
    return any(operation.main == a.part and b.part in operation.carries for operation in assembly.operations)


def _looseness(assembly: Assembly, contact: Contact, play_m: float, unit_m: float) -> float:
    """How far a contact may be off, in units of the largest play.

    A sheet of a plane through the axis counts less, since the play of a shaft is a disc.
    """
    size = assembly.play(contact, play_m) / unit_m if unit_m else 0.0
    return size * _DISC if contact in assembly.origin and not assembly.face(contact.manipulated).opposes else size


def _carried_shifts(assembly: Assembly, part: str, after: int, loose: _Loose) -> list[tuple[_Shift, float]]:
    """The displacements within its carriers by which a part is off after an operation, with signs.

    Each carrier adds the shift at which the part lay before (-1), and the one at the end of being carried (+1).
    """
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
    """The fit contacts between two parts that stand before an operation: (made by, normal of the part, play in
    units).
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
