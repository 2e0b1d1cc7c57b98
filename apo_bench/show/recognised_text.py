"""What `apo-bench recognise` found, as a table, in sentences and as JSON."""

from math import degrees
from typing import Any

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.recognition.evidence import Recognised
from apo_bench.trial.recognised_contacts import count_contacts

_SCHEMA = "apo-bench/recognised/2"
_SURE = 0.9
"""Sets that are less likely are called not certain."""


def evidence_table(recognised: Recognised, right: Assembly) -> Any:
    """One line per contact, with what was measured and what was allowed."""
    from rich.table import Column, Table

    names = ("seen gap mm", "gap mm", "allowed", "angle deg", "allowed", "overlap")
    numbers = (Column(name, justify="right") for name in names)
    table = Table("", "manipulated", "environment", *numbers, "", box=None, pad_edge=False, header_style="bold")
    in_scenario = {(relation.made, relation.contact) for relation in right.relations()}
    for e in recognised.evidence:
        table.add_row(
            str(e.made + 1),
            str(e.contact.manipulated),
            str(e.contact.environment),
            f"{_mm(e.seen_gap_m):z.2f}",
            f"{_mm(e.gap_m):z.2f}",
            f"{_mm(e.most.gap_m):.2f}",
            f"{degrees(e.angle_rad):z.2f}",
            f"{degrees(e.most.angle_rad):.2f}",
            f"{100 * e.share:.0f} %",
            "" if (e.made, e.contact) in in_scenario else "not in the scenario",
        )
    return table


def difference_lines(observation: Observation, recognised: Recognised) -> list[str]:
    """`all 9 contacts of the scenario were recognised, and no other`, or what differs."""
    count = count_contacts(observation.assembly, recognised.assembly)
    missed = [f"missed: {k + 1}: {contact}" for k, contact in _missed(observation.assembly, recognised)]
    total = count["contacts_right"] + count["contacts_missed"]
    if not missed and not count["contacts_false"]:
        return [f"all {total} contacts of the scenario were recognised, and no other"]
    line = f"{count['contacts_right']} of the {total} contacts of the scenario were recognised"
    return [f"{line}, and {count['contacts_false']} that it does not have", *missed]


def confidence_line(recognised: Recognised) -> list[str]:
    """How likely the set of contacts is, and what the next best one would change; nothing where none were compared."""
    if recognised.probability is None:
        return []
    sentence = (
        f"{'not certain: ' * (recognised.probability < _SURE)}this set of contacts is right with probability "
        f"{recognised.probability:.2f}, of those that were compared"
    )
    if recognised.rival is None:
        return [sentence]
    added, gone = _changes(recognised.assembly, recognised.rival.assembly)
    change = [f"{word} {', '.join(names)}" for word, names in (("with", added), ("without", gone)) if names]
    return [f"{sentence}; the next ({recognised.rival.probability:.2f}) is {' and '.join(change)}"]


def _changes(best: Assembly, other: Assembly) -> tuple[list[str], list[str]]:
    """What another set has more, and what it lacks: `5: cube.px on castle2.nx`."""
    mine, others = ({f"{r.made + 1}: {r.contact}" for r in of.relations()} for of in (best, other))
    return sorted(others - mine), sorted(mine - others)


def recognition_form(
    name: str, kind: str, observation: Observation, recognised: Recognised, assumed: bool
) -> dict[str, Any]:
    """Everything, in mm and degrees; operations from 1."""
    in_scenario = {(relation.made, relation.contact) for relation in observation.assembly.relations()}
    rival = recognised.rival
    added, gone = _changes(recognised.assembly, rival.assembly if rival else recognised.assembly)
    return {
        "schema": _SCHEMA,
        "scenario": name,
        "relations": kind,
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


def _missed(right: Assembly, recognised: Recognised) -> list[tuple[int, Contact]]:
    named = {(e.made, e.contact) for e in recognised.evidence}
    return [(r.made, r.contact) for r in right.relations() if (r.made, r.contact) not in named]


def _mm(metres: float) -> float:
    """No -0."""
    return round(1e3 * metres, 6) + 0.0
