"""The result of contact detection: the detected contacts, with the measured evidence for each."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple, final

from apo_bench.assembly import Assembly, Contact, FacingPair, Observation, Poses, measure_face_gap
from apo_bench.perception.detection.thresholds import PairThresholds


@final
@dataclass(frozen=True)
class Evidence:
    """The evidence for one contact: the values measured when the detector took it, and the thresholds."""

    contact: Contact
    made: int
    """The operation that made it, counted from 0."""
    gap_m: float
    """Gap at the poses updated by the contacts taken before; positive if apart, negative if the parts overlap."""
    angle_rad: float
    """Angle between one normal and the opposite of the other, or between the axes of round faces."""
    share: float
    """Overlap as a fraction of the smaller face."""
    largest_distance: PairThresholds
    """Largest gap and angle that were allowed."""
    seen_gap_m: float
    """The gap at the observed poses."""


class Rival(NamedTuple):
    """The second best set of contacts, where several were compared."""

    assembly: Assembly
    """The assembly with these contacts."""
    probability: float
    """Posterior probability among the sets that were compared to the end."""


@final
@dataclass(frozen=True, eq=False)
class DetectedContacts:
    """The assembly with the detected contacts; in each contact the faces coincide, without a gap."""

    assembly: Assembly
    evidence: tuple[Evidence, ...]
    """One for each contact, in the order of `assembly.relations()`."""
    probability: float | None = None
    """Posterior probability of the set among those compared to the end; None if the detector does not compare sets."""
    rival: Rival | None = None


def remove_contacts(observation: Observation) -> Observation:
    """The observation with all contacts and gaps removed."""
    return replace(observation, assembly=replace(keep_evident_contacts(observation.assembly, ()), gaps={}))


def keep_evident_contacts(assembly: Assembly, evidence: Iterable[Evidence]) -> Assembly:
    """The assembly with the contacts of the evidence as its only contacts, in the order of the evidence."""
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
    """The evidence for the contacts of operation k, sorted by part and face.

    Args:
        k: The operation, counted from 0.
        taken: For each contact the measured pair and its thresholds.
        is_uncorrected: Observed pose of every part after the operation, world, [m].
    """
    solids = assembly.solids
    parts = (assembly.operations[k].moves, tuple(solids))

    def place(each: tuple[Contact, FacingPair, PairThresholds]) -> list[int]:
        # Sort key: index of part and of face, of the manipulated face, then of the environment face.
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
