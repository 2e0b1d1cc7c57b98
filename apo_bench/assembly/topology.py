"""Topology of a demonstration in the paper's terms: operations, contacts and ODLs; symbols only, no poses."""

import math
from bisect import bisect
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from types import MappingProxyType
from typing import Literal, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly.contact_kinds import WALLS, classify_contact, compute_geometric_play
from apo_bench.geometry import Array, Face, RoundFace, Solid, copy_frozen, freeze, make_copyable, pose, remember


class PartFace(NamedTuple):
    """A face of a part, written `castle1.topP`."""

    part: str
    face: str

    def __str__(self) -> str:
        return f"{self.part}.{self.face}"


class Contact(NamedTuple):
    """A face of the manipulated part lies on a face of the environment part (an arc of Section 3.1)."""

    manipulated: PartFace
    environment: PartFace

    def __str__(self) -> str:
        return f"{self.manipulated} on {self.environment}"


GapKind = Literal["contact", "centred", "clearance"]
"""The kinds of gap, see `Gap`."""


class Gap(NamedTuple):
    """The requested distance of the nominal faces of a contact.

    `centred` (the default): the faces coincide, so parts with play are in the middle of it. `contact`: the physical
    faces touch, so nominal faces of fit parts overlap by the play. `clearance`: anywhere in an interval.
    """

    kind: GapKind = "centred"
    low_m: float | None = None
    """The least distance of a `clearance`, negative for overlap; None: minus the play."""
    high_m: float | None = None
    """The largest distance of a `clearance`; None: the play."""

    def __str__(self) -> str:
        """`centred`, `clearance`, `clearance from -0.2 to 0.3 mm`."""
        if self.low_m is None or self.high_m is None:
            return self.kind
        return f"{self.kind} from {1e3 * self.low_m:g} to {1e3 * self.high_m:g} mm"

    def interval(self, play_m: float) -> tuple[float, float]:
        """Least and greatest distance along the normal, [m], for parts with this play per side."""
        asked = -play_m if self.low_m is None else self.low_m, play_m if self.high_m is None else self.high_m
        return {"centred": (0.0, 0.0), "contact": (-play_m, -play_m), "clearance": asked}[self.kind]


@final
@check_arguments
@dataclass(frozen=True)
class Operation:
    """One operation, without poses: the main part, the contacts that it makes, and the parts that it carries."""

    main: str
    contacts: tuple[Contact, ...] = ()
    carries: tuple[str, ...] = ()
    clamped: bool = False
    """Whether the main part is fixed to what it touches once it is in place, as by screws that no operation drives."""

    @property
    def moves(self) -> tuple[str, ...]:
        """Every part that moves, the main one first."""
        return (self.main, *self.carries)


class Term(NamedTuple):
    """One term of an ODL: the motion parameter T of an operation (counted from 0), or its inverse."""

    operation: int
    inverse: bool = False


ODL = tuple[Term, ...]
"""An operation dependency list (Section 3.2.1): T6 T5^-1 T2 is `(Term(5), Term(4, True), Term(1))`."""


class Relation(NamedTuple):
    """A contact with its history: disappeared relations are kept (Section 3.2.2)."""

    contact: Contact
    made: int
    """The operation that made it, counted from 0."""
    lost: int | None
    """The operation that moved one of its parts away, or None while it stands."""


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Assembly:
    """What is certain about a task: solids, operations and their contacts, fixed parts. It has no poses.

    Examples:
        >>> import apo_bench
        >>> assembly = apo_bench.load_scenario("stick_in_tower").assembly
        >>> len(assembly), [operation.main for operation in assembly.operations]
        (3, ['castle1', 'castle2', 'stick'])
        >>> print(assembly.operations[2].contacts[0])
        stick.nz on castle1.sfl
    """

    solids: Mapping[str, Solid]
    """Part -> its nominal shape, part frame, [m]."""
    operations: tuple[Operation, ...]
    """For each operation the part that moves, the contacts that it makes, and the parts that it carries."""
    fixed: frozenset[str]
    """Parts that no operation moves, such as the table (stable objects, Section 2.3 of the paper)."""
    gaps: Mapping[Contact, Gap] = field(default_factory=dict)
    """Contact -> requested gap; faces of a contact that is not named coincide."""
    sheets: Mapping[PartFace, Face] = field(default_factory=dict)
    """Planes and points that replace round faces in the contact equations."""
    origin: Mapping[Contact, Contact] = field(default_factory=dict)
    """Contact of sheets -> the contact of round faces that it stands for."""

    def __post_init__(self) -> None:
        freeze(self, solids=None, gaps=None, sheets=None, origin=None)

    def __len__(self) -> int:
        return len(self.operations)

    def face(self, of: PartFace) -> Face:
        """A flat face, or a sheet."""
        return self.sheets[of] if of in self.sheets else self.solids[of.part].faces[of.face]

    def round_face(self, of: PartFace) -> RoundFace:
        return self.solids[of.part].rounds[of.face]

    def face_of(self, of: PartFace) -> Face | RoundFace:
        """The face of a part: flat, round, or a sheet."""
        return self.sheets[of] if of in self.sheets else self.solids[of.part].face(of.face)

    def is_round(self, contact: Contact) -> bool:
        """Whether a face of the contact is round."""
        return any(of.face in self.solids[of.part].rounds for of in contact)

    def is_fit(self, contact: Contact) -> bool:
        """Whether a face of the contact recedes by the clearance."""
        return self.face_of(contact.manipulated).fit or self.face_of(contact.environment).fit

    def given(self, contact: Contact) -> Contact:
        """The contact of round faces for which a contact of sheets stands; any other contact itself."""
        return self.origin.get(contact, contact)

    def play(self, contact: Contact, play_m: float) -> float:
        """How far a contact may be from nominal, [m]: the clearance of fit parts, plus the difference of radii.

        For the seat of a cone the clearance of the walls becomes an axial distance, clearance / sin(half angle).
        """
        whole = self.given(contact)
        fits = play_m if self.is_fit(whole) else 0.0
        if not self.is_round(whole):
            return fits
        a = self.face_of(whole.manipulated)
        b = self.face_of(whole.environment)
        if contact in self.origin and self.face(contact.manipulated).opposes:
            slope = max(abs(face.slope) for face in (a, b) if isinstance(face, RoundFace))
            return fits * math.hypot(1.0, slope) / slope
        return max(0.0, fits + compute_geometric_play(a, b))

    def interval(self, contact: Contact, play_m: float) -> tuple[float, float]:
        """Least and greatest allowed distance of a contact, [m]; they are equal unless its gap is a `clearance`.

        The play of a shaft in its hole is a disc, replaced by a polygon with its corners on the circle.
        """
        gap = self.gaps.get(contact, Gap())
        low, high = gap.interval(self.play(contact, play_m))
        whole = self.given(contact)
        if (
            gap.kind == "clearance"
            and whole != contact
            and classify_contact(*map(self.face_of, whole)) == "shaft in hole"
        ):
            inside = math.cos(math.pi / (2 * WALLS))
            return low * inside, high * inside
        return low, high

    @remember
    def intervals(self, play_m: float) -> Array:
        """The least and greatest allowed distance of every contact, (c, 2), in the order of `relations()`, [m]."""
        return copy_frozen(
            np.reshape([self.interval(relation.contact, play_m) for relation in self.relations()], (-1, 2))
        )

    def first(self, n: int) -> "Assembly":
        """The assembly with only its first n operations."""
        return replace(self, operations=self.operations[:n])

    def odls(self) -> tuple[Mapping[str, ODL], ...]:
        """The ODL of every part moved so far, after each operation (Section 3.2.1).

        A part that was never moved has none: it rests where it started.
        """
        return tuple(MappingProxyType(dict(now)) for now in self.walk())

    def walk(self) -> Iterator[Mapping[str, ODL]]:
        """Yield the ODL of every part after each operation; the mapping is overwritten by the next operation."""
        current: dict[str, ODL] = {}
        for k, operation in enumerate(self.operations):
            carried_by = current.get(operation.main, ())
            for part in operation.carries:
                current[part] = simplify_odl((Term(k), *invert(carried_by), *current.get(part, ())))
            current[operation.main] = (Term(k),)
            yield current

    @remember
    def relations(self) -> tuple[Relation, ...]:
        """Every contact ever made, in the order of the operations."""
        moved: dict[str, list[int]] = {}
        for k, operation in enumerate(self.operations):
            for part in operation.moves:
                moved.setdefault(part, []).append(k)
        return tuple(
            Relation(contact, k, _find_losing_operation(moved, contact, k))
            for k, operation in enumerate(self.operations)
            for contact in operation.contacts
        )

    @remember
    def arcs(self) -> tuple[tuple[int, ...], ...]:
        """The contacts of R1, R2, ...: all that one operation makes between one pair of parts (Section 3.1).

        Contacts by their number in `relations()`; arcs in the order in which they were made.
        """
        contacts_by_pair: dict[tuple[int, frozenset[str]], list[int]] = {}
        for i, (contact, made, _) in enumerate(self.relations()):
            contacts_by_pair.setdefault((made, frozenset(of.part for of in contact)), []).append(i)
        return tuple(map(tuple, contacts_by_pair.values()))

    @check_arguments
    def without(self, left_out: Collection[str]) -> NDArray[np.bool_]:
        """Which contacts remain, (c,) in the order of `relations()`, when some are left out.

        Args:
            left_out: Whole relations, such as `R3`, or single contacts of one, such as `R3: stick.py on castle1.spy`.
        """
        relations = self.relations()
        if not left_out:
            return np.ones(len(relations), dtype=np.bool_)
        arc_of = {j: f"R{i}" for i, arc in enumerate(self.arcs(), start=1) for j in arc}
        names = [(arc_of[j], f"{arc_of[j]}: {self.given(each.contact)}") for j, each in enumerate(relations)]
        return np.array([not {*both}.intersection(left_out) for both in names], dtype=np.bool_)


def _find_losing_operation(moved: Mapping[str, Sequence[int]], contact: Contact, made: int) -> int | None:
    """The first operation after `made` that moves one of the two parts without the other."""
    ends = [moved.get(end.part, ()) for end in contact]
    later = set(ends[0][bisect(ends[0], made) :]).symmetric_difference(ends[1][bisect(ends[1], made) :])
    return min(later, default=None)


def invert(odl: Iterable[Term]) -> ODL:
    """The inverse product: reversed order, each term inverted."""
    return tuple(Term(k, not inverse) for k, inverse in reversed(tuple(odl)))


def simplify_odl(odl: Sequence[Term]) -> ODL:
    """The ODL without neighbours that cancel, such as T2 T2^-1."""
    out: list[Term] = []
    for term in odl:
        if out and out[-1] == (term.operation, not term.inverse):
            out.pop()
        else:
            out.append(Term(*term))
    return tuple(out)


def spell(odl: Iterable[Term]) -> str:
    """The ODL as the paper writes it, counted from 1: `T6 T5^-1 T2`; the empty product is `I`."""
    return " ".join(f"T{k + 1}{'^-1' if inverse else ''}" for k, inverse in odl) or "I"


def evaluate_odl(odl: Iterable[Term], poses: Array) -> Array:
    """The pose of an ODL, (4, 4), given the motion parameters `poses`, (n, 4, 4)."""
    return reduce(np.matmul, (pose.inverse(poses[k]) if inverse else poses[k] for k, inverse in odl), np.eye(4))
