"""Detected contacts, compared with those of the scenario, as one JSON object."""

from math import degrees
from typing import Any

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.perception.detection.evidence import DetectedContacts
from apo_bench.trial.detected_contacts import count_contacts

_SCHEMA = "apo-bench/detected-contacts/1"
CONTACT_COLUMNS = {
    "operation": "d",
    "manipulated": "",
    "environment": "",
    "observed_gap_mm": "z.2f",
    "gap_mm": "z.2f",
    "allowed_gap_mm": ".2f",
    "angle_deg": "z.2f",
    "allowed_angle_deg": ".2f",
    "overlap": ".0%",
    "in_scenario": "",
}
"""Columns of the contacts of `make_detection_form`, with their formats."""


def make_detection_form(
    scenario: str, contact_source: str, observation: Observation, detected: DetectedContacts, assumed: bool
) -> dict[str, Any]:
    """Return detected contacts as a JSON object: mm and degrees, operations from 1.

    Args:
        contact_source: Name of the detection, as in `--contact-source`.
        assumed: Whether the standard deviations of the observation were assumed, not stated.

    Returns:
        The object; `missed` lists contacts of the scenario that were not detected, and `next` describes the second most
        probable set of contacts.
    """
    right = {(relation.made, relation.contact) for relation in observation.assembly.relations()}
    found = {(each.made, each.contact) for each in detected.evidence}
    rival = detected.rival
    # contacts by name, of the most probable set and of the next one
    mine = _name_contacts(detected.assembly)
    others = mine if rival is None else _name_contacts(rival.assembly)
    return {
        "schema": _SCHEMA,
        "scenario": scenario,
        "contact_source": contact_source,
        "deviation_assumed": assumed,
        "unobserved": [k + 1 for k, seen in enumerate(observation.observed) if not seen],
        "contacts": [
            _make_contact_form(each.made, each.contact)
            | {
                "observed_gap_mm": _to_mm(each.seen_gap_m),
                "gap_mm": _to_mm(each.gap_m),
                "allowed_gap_mm": _to_mm(each.largest_distance.gap_m),
                "angle_deg": degrees(each.angle_rad),
                "allowed_angle_deg": degrees(each.largest_distance.angle_rad),
                "overlap": each.share,
                "in_scenario": (each.made, each.contact) in right,
            }
            for each in detected.evidence
        ],
        "missed": [_make_contact_form(*missed) for missed in sorted(right - found, key=str)],
        **count_contacts(observation.assembly, detected.assembly),
        "probability": detected.probability,
        "next": rival
        and {"probability": rival.probability, "with": sorted(others - mine), "without": sorted(mine - others)},
    }


def _name_contacts(assembly: Assembly) -> set[str]:
    """Return `5: cube.px on castle2.nx` for each contact; the number is that of the operation, from 1."""
    return {f"{relation.made + 1}: {relation.contact}" for relation in assembly.relations()}


def _make_contact_form(operation: int, contact: Contact) -> dict[str, Any]:
    return {"operation": operation + 1} | {key: str(face) for key, face in contact._asdict().items()}


def _to_mm(metres: float) -> float:
    """Convert to mm, rounded; adding 0.0 turns -0.0 into 0.0."""
    return round(1e3 * metres, 6) + 0.0
