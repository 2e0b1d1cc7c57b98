"""Detected contacts, with the evidence for each."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple, final

from apo_bench.assembly import Assembly, Contact, FacingPair, Observation, Poses, measure_face_gap
from apo_bench.perception.detection.thresholds import PairThresholds


@final
@dataclass(frozen=True)
class Evidence:
    """The evidence for a contact: what was measured when it was taken, and what was allowed."""

    contact: Contact
    made: int
    """The operation that made it, counted from 0."""
    gap_m: float
    """Above 0 apart, below 0 inside each other, where the contacts taken before put the parts."""
    angle_rad: float
    share: float
    """Overlap over the smaller face."""
    most: PairThresholds
    """The thresholds."""
    seen_gap_m: float
    """The gap at the poses as they were observed."""


class Rival(NamedTuple):
    """The next best set of contacts, where several were compared."""

    assembly: Assembly
    probability: float


@final
@dataclass(frozen=True, eq=False)
class DetectedContacts:
    """The assembly with the contacts that were detected, in all of which faces coincide."""

    assembly: Assembly
    evidence: tuple[Evidence, ...]
    """One for each contact, in the order of `assembly.relations()`."""
    probability: float | None = None
    """Of the set among those that were compared to the end; None where sets are not compared."""
    rival: Rival | None = None


def without_contacts(observation: Observation) -> Observation:
    """What was observed, with no contact of any operation."""
    return replace(observation, assembly=replace(keep_evident_contacts(observation.assembly, ()), gaps={}))


def keep_evident_contacts(assembly: Assembly, evidence: Iterable[Evidence]) -> Assembly:
    """The assembly whose operations make the contacts that the evidence is of, in its order."""
    contacts: list[list[Contact]] = [[] for _ in assembly.operations]
    for each in evidence:
        contacts[each.made].append(each.contact)
    operations = tuple(
        replace(operation, contacts=tuple(touching))
        for operation, touching in zip(assembly.operations, contacts, strict=True)
    )
    return replace(assembly, operations=operations)


def collect_evidence(
    assembly: Assembly, k: int, taken: Iterable[tuple[Contact, FacingPair, PairThresholds]], is_uncorrected: Poses
) -> list[Evidence]:
    """What speaks for the contacts of operation k, in the order of parts and faces.

    Args:
        as_seen: Where every part was observed after the operation, world, [m].
    """
    solids = assembly.solids
    parts = (assembly.operations[k].moves, tuple(solids))

    def place(each: tuple[Contact, FacingPair, PairThresholds]) -> list[int]:
        return [
            i
            for of, among in zip(each[0], parts, strict=True)
            for i in (among.index(of.part), [*solids[of.part].faces, *solids[of.part].rounds].index(of.face))
        ]

    evidence = list[Evidence]()
    for contact, pair, most in sorted(taken, key=place):
        a, b = contact
        seen_gap_m = measure_face_gap(
            assembly.face_of(a), is_uncorrected[a.part], assembly.face_of(b), is_uncorrected[b.part]
        )
        evidence.append(Evidence(contact, k, pair.gap_m, pair.angle_rad, pair.share, most, seen_gap_m))
    return evidence
