"""What the play of parts that fit does to the contact equations: by how much each is off, and which are off together.

Two parts that fit are off by one displacement, uniform within the play along every normal at which they fit: faces
that look opposite ways are off by the same amount. A part that is carried inside another one also shifts within their
play until it is let go of, so its later contacts are off by where it lay in its carrier before, and by where it lies
then: play adds up along what is carried.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from apo_bench.assembly.equations import pattern
from apo_bench.assembly.topology import Assembly, PartFace
from apo_bench.geometry.arrays import Array, frozen
from apo_bench.geometry.remembered import remembered

LARGEST_CORRELATED = 300
"""Contacts above which the play of each is taken for its own: a covariance of all of them is a dense matrix."""


class _Shift(NamedTuple):
    """One displacement of a part within another one, in the frame of the part; equal ones are the same."""

    part: str
    other: str
    made: int
    """The operation that brought them together."""
    until: int
    """The operation after which it is asked for: that one, or one that carried the part."""


@remembered
def plays(assembly: Assembly) -> Array:
    """How many independent plays each contact is off by, (c,), in the order of `relations()`."""
    return frozen(np.array([sum(float(n @ n) for n in shifts.values()) for shifts in _shifts(assembly)]))


@remembered
def fit_covariance(assembly: Assembly, play_m: float) -> Array | None:
    """The covariance of the compact equations that play causes, (3 c, 3 c), [m^2]; None of too many, or without play.

    Only the first row of each contact, its centre, goes with others: what turns parts within their play turns each in
    its own way.
    """
    shifts, count = _shifts(assembly), plays(assembly)
    if not count.any() or not play_m or len(shifts) > LARGEST_CORRELATED:
        return None
    every = {shift: 3 * i for i, shift in enumerate(dict.fromkeys(shift for own in shifts for shift in own))}
    by = np.zeros((len(shifts), 3 * len(every)))
    for row, own in zip(by, shifts, strict=True):
        for shift, n in own.items():
            row[every[shift] : every[shift] + 3] = n
    each = play_m**2 / 3.0 * np.diff(pattern(assembly).begin)
    by *= np.sqrt(each)[:, None]
    S = np.diag(np.repeat(count * each, 3))
    S[::3, ::3] = by @ by.T
    return frozen(S)


@remembered
def _shifts(assembly: Assembly) -> tuple[dict[_Shift, Array], ...]:
    """What each contact is off by, in the order of `relations()`: by how much, (3,), of each displacement.

    A face comes nearer if its part moves along the normal; where a part is thought to be is off by how much it has
    moved within its carrier since.
    """
    found = []
    for contact, made, _ in assembly.relations():
        own = dict[_Shift, Array]()
        if assembly.is_fit(contact):
            inner, outer = contact if not _ever_carries(assembly, *contact) else contact[::-1]
            own[_Shift(inner.part, outer.part, made, made)] = -assembly.face(inner).normal
        for face in contact:
            n = assembly.face(face).normal
            for shift, way in _carried(assembly, face.part, made):
                added = own.get(shift, np.zeros(3)) + way * (_fitting(assembly, shift) @ n)
                own[shift] = added
        found.append(own)
    return tuple(found)


def _ever_carries(assembly: Assembly, a: PartFace, b: PartFace) -> bool:
    """Whether the part of a face ever carries that of another one, which is asked for in its frame then."""
    return any(operation.main == a.part and b.part in operation.carries for operation in assembly.operations)


def _carried(assembly: Assembly, part: str, after: int) -> list[tuple[_Shift, float]]:
    """The displacements within carriers by which a part is off after an operation: as it lay at first, and then."""
    found = list[tuple[_Shift, float]]()
    for k in range(after, -1, -1):
        operation = assembly.operations[k]
        if part == operation.main:
            break
        if part in operation.carries:
            made = max((m for m, *_ in _together(assembly, part, operation.main, k)), default=None)
            if made is not None:
                before = _Shift(part, operation.main, made, made)
                found += [(before, -1.0), (before._replace(until=k), 1.0)]
    return found


def _together(assembly: Assembly, part: str, other: str, before: int) -> list[tuple[int, Array]]:
    """The contacts that fit of a part with another one that stand before an operation: who made it, its normal."""
    found = []
    for contact, made, lost in assembly.relations():
        faces = {face.part: face for face in contact}
        stands = made < before and (lost is None or lost >= before)
        if stands and faces.keys() == {part, other} and assembly.is_fit(contact):
            found.append((made, assembly.face(faces[part]).normal))
    return found


def _fitting(assembly: Assembly, shift: _Shift) -> Array:
    """The projection onto the directions along which a part fits into another one, (3, 3)."""
    normals = np.array([n for _, n in _together(assembly, shift.part, shift.other, shift.made + 1)])
    return np.asarray(np.linalg.pinv(normals) @ normals)
