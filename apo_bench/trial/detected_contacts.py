"""Replace the contacts of an observation by detected ones, and count how many of them are right."""

from dataclasses import replace

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.perception.detection.evidence import DetectedContacts
from apo_bench.perception.detection.greedy_detection import detect_contacts
from apo_bench.perception.detection.joint_detection import detect_contacts_jointly


def detect_with_source(observation: Observation, source: str = "detected") -> DetectedContacts:
    """Find the contacts of an observation without reading those that it has.

    Args:
        source: `detected`, from the observed poses and their stated noise; or `detected-jointly`, contacts and poses
            together.
    """
    return detect_contacts_jointly(observation) if source == "detected-jointly" else detect_contacts(observation)


def use_detected_contacts(observation: Observation, source: str) -> Observation:
    """The observation with detected contacts in place of its own; `source` as in `detect_with_source`."""
    return replace(observation, assembly=detect_with_source(observation, source).assembly)


def count_contacts(right: Assembly, given: Assembly) -> dict[str, int]:
    """Count the true positive, false negative and false positive contacts of `given`, as columns of a record."""
    true = _name_contacts(right)
    named = _name_contacts(given)
    return {
        "contacts_true_positive": len(true & named),
        "contacts_false_negative": len(true - named),
        "contacts_false_positive": len(named - true),
    }


def _name_contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    """Pairs (operation that makes the contact, contact)."""
    return {(relation.made, relation.contact) for relation in assembly.relations()}
