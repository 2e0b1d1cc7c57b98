"""What `apo-bench detect-contacts` found, as a table, in sentences and as JSON."""

from math import degrees
from typing import Any

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.perception.detection.evidence import DetectedContacts
from apo_bench.trial.detected_contacts import count_contacts
from apo_bench.viz.tables import form_table

_SCHEMA = "apo-bench/recognised/2"
_SURE = 0.9  # sets that are less likely are called not certain
_COLUMNS = {
    "operation": "d",
    "manipulated": "",
    "environment": "",
    "seen_gap_mm": "z.2f",
    "gap_mm": "z.2f",
    "allowed_gap_mm": ".2f",
    "angle_deg": "z.2f",
    "allowed_angle_deg": ".2f",
    "overlap": ".0%",
    "in_scenario": "",
}


def evidence_table(form: dict[str, Any]) -> Any:
    """One line per contact of `recognition_form`, with what was measured and what was allowed."""
    return form_table(form["contacts"], _COLUMNS)


def difference_lines(form: dict[str, Any]) -> list[str]:
    """`all 9 contacts of the scenario were recognised, and no other`, or what differs."""
    right = form["contacts_true_positive"]
    whole = right + form["contacts_false_negative"]
    if right == whole and not form["contacts_false_positive"]:
        return [f"all {whole} contacts of the scenario were recognised, and no other"]
    line = f"{right} of the {whole} contacts of the scenario were recognised"
    missed = [f"missed: {c['operation']}: {c['manipulated']} on {c['environment']}" for c in form["missed"]]
    return [f"{line}, and {form['contacts_false_positive']} that it does not have", *missed]


def confidence_lines(form: dict[str, Any]) -> list[str]:
    """How likely the set of contacts is, and what the next best one would change; nothing where none were compared."""
    probability = form["probability"]
    if probability is None:
        return []
    doubt = "not certain: " * (probability < _SURE)
    sentence = f"{doubt}this set of contacts is right with probability {probability:.2f}, of those that were compared"
    if form["next"] is None:
        return [sentence]
    change = [f"{word} {', '.join(form['next'][word])}" for word in ("with", "without") if form["next"][word]]
    return [f"{sentence}; the next ({form['next']['probability']:.2f}) is {' and '.join(change)}"]


def _changes(best: Assembly, other: Assembly) -> tuple[list[str], list[str]]:
    """What another set has more, and what it lacks: `5: cube.px on castle2.nx`."""
    mine, others = ({f"{r.made + 1}: {r.contact}" for r in of.relations()} for of in (best, other))
    return sorted(others - mine), sorted(mine - others)


def recognition_form(
    name: str, kind: str, observation: Observation, recognised: DetectedContacts, assumed: bool
) -> dict[str, Any]:
    """Everything, in mm and degrees; operations from 1."""
    in_scenario = {(relation.made, relation.contact) for relation in observation.assembly.relations()}
    rival = recognised.rival
    added, gone = _changes(recognised.assembly, rival.assembly if rival else recognised.assembly)
    return {
        "schema": _SCHEMA,
        "scenario": name,
        "contact_source": kind,
        "deviation_assumed": assumed,
        "contacts": [
            _contact_form(e.made, e.contact)
            | {
                "seen_gap_mm": _mm(e.seen_gap_m),
                "gap_mm": _mm(e.gap_m),
                "allowed_gap_mm": _mm(e.most.gap_m),
                "angle_deg": degrees(e.angle_rad),
                "allowed_angle_deg": degrees(e.most.angle_rad),
                "overlap": e.share,
                "in_scenario": (e.made, e.contact) in in_scenario,
            }
            for e in recognised.evidence
        ],
        "missed": [_contact_form(*missed) for missed in _missed(observation.assembly, recognised)],
        **count_contacts(observation.assembly, recognised.assembly),
        "probability": recognised.probability,
        "next": rival and {"probability": rival.probability, "with": added, "without": gone},
    }


def _contact_form(operation: int, contact: Contact) -> dict[str, Any]:
    return {
        "operation": operation + 1,
        "manipulated": str(contact.manipulated),
        "environment": str(contact.environment),
    }


def _missed(right: Assembly, recognised: DetectedContacts) -> list[tuple[int, Contact]]:
    named = {(e.made, e.contact) for e in recognised.evidence}
    return [(r.made, r.contact) for r in right.relations() if (r.made, r.contact) not in named]


def _mm(metres: float) -> float:
    """No -0."""
    return round(1e3 * metres, 6) + 0.0
