"""Relations that were recognised instead of given, and how many of them are right.

`recognised`          from the seen poses and their stated noise
`recognised-fixed`    with the paper's fixed thresholds
`recognised-twice`    recognised, corrected by `contact`, and recognised again where the correction puts the parts, with
                      what it leaves uncertain as the noise
`recognised-jointly`  contacts and poses decided together: the set of contacts that explains best what was seen

The truth, the robot and the judge keep the relations of the scenario.
"""

from dataclasses import replace

from apo_bench.assembly import Assembly, Contact, Observation
from apo_bench.correction.correctors import correct
from apo_bench.observation.models import floored
from apo_bench.recognition.contacts import recognise
from apo_bench.recognition.jointly import recognise_jointly
from apo_bench.recognition.thresholds import FIXED_RULES, Recognised


def recognise_by(observation: Observation, kind: str = "recognised") -> Recognised:
    """The contacts of an observation, found in one of the ways of `RECOGNISED`; its own are not looked at."""
    if kind == "recognised-fixed":
        return recognise(observation, FIXED_RULES)
    if kind == "recognised-jointly":
        return recognise_jointly(observation)
    first = recognise(observation)
    return first if kind == "recognised" else _again(observation, first)


def with_recognised_contacts(observation: Observation, kind: str) -> Observation:
    """The observation with the contacts that were recognised in place of its own."""
    return replace(observation, assembly=recognise_by(observation, kind).assembly)


def count_contacts(right: Assembly, told: Assembly) -> dict[str, int]:
    """How many of the contacts that were given are right, how many were missed, how many are false."""
    true = _contacts(right)
    named = _contacts(told)
    return {
        "contacts_right": len(true & named),
        "contacts_missed": len(true - named),
        "contacts_false": len(named - true),
    }


def _again(observation: Observation, first: Recognised) -> Recognised:
    """Recognise at the corrected goals; if there is no correction, the first is the last word."""
    correction = correct(replace(observation, assembly=first.assembly), "contact")
    if not correction.ok or correction.covariance is None:
        return first
    corrected = replace(
        observation, goals=correction.goals, covariance=floored(correction.covariance), shared=(), tails=None
    )
    return recognise(corrected, first_seen=observation.goals)


def _contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}
