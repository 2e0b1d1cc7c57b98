"""Contacts that were recognised instead of given, and how many of them are right.

`recognised`          from the seen poses and their stated noise
`recognised-jointly`  contacts and poses decided together: the set of contacts that explains best what was seen

The truth, the robot and the judge keep the contacts of the scenario.
"""

from dataclasses import replace

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.perception.detection.contacts import detect_contacts
from apo_bench.perception.detection.evidence import DetectedContacts
from apo_bench.perception.detection.jointly import detect_contacts_jointly


def recognise_by(observation: Observation, kind: str = "detected") -> DetectedContacts:
    """Find the contacts of an observation in one of the ways of `RECOGNISED`, without those that came with it."""
    return detect_contacts_jointly(observation) if kind == "detected-jointly" else detect_contacts(observation)


def with_recognised_contacts(observation: Observation, kind: str) -> Observation:
    """The observation with the contacts that were recognised in place of its own."""
    return replace(observation, assembly=recognise_by(observation, kind).assembly)


def count_contacts(right: Assembly, told: Assembly) -> dict[str, int]:
    """How many of the contacts that were given are right, how many were missed, how many are false."""
    true = _contacts(right)
    named = _contacts(told)
    return {
        "contacts_true_positive": len(true & named),
        "contacts_false_negative": len(true - named),
        "contacts_false_positive": len(named - true),
    }


def _contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}
