"""Relations that were recognised instead of given, and how many of them are right.

`recognised`        from the seen poses and their stated noise
`recognised-fixed`  with the paper's fixed thresholds
`recognised-twice`  recognised, corrected by `contact`, and recognised again where the correction puts the parts, with
                    what it leaves uncertain as the noise

The truth, the robot and the judge keep the relations of the scenario.
"""

from __future__ import annotations

from dataclasses import replace

from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly, Contact
from apo_bench.correction.correctors import correct
from apo_bench.observation.models.isotropic import floored
from apo_bench.recognition.contacts import Recognised, recognise
from apo_bench.recognition.thresholds import FIXED_RULES


def recognised(seen: Observation, kind: str = "recognised") -> Recognised:
    """The contacts of an observation, found in one of the ways of `RECOGNISED`; its own are not looked at."""
    if kind == "recognised-fixed":
        return recognise(seen, FIXED_RULES)
    first = recognise(seen)
    return first if kind == "recognised" else _again(seen, first)


def understood(seen: Observation, kind: str) -> Observation:
    """The same observation with the contacts that were recognised."""
    return replace(seen, assembly=recognised(seen, kind).assembly)


def counted(right: Assembly, told: Assembly) -> dict[str, int]:
    """How many of the contacts that were told are right, how many were missed, how many are false."""
    there, named = _contacts(right), _contacts(told)
    return {
        "contacts_right": len(there & named),
        "contacts_missed": len(there - named),
        "contacts_false": len(named - there),
    }


def _again(seen: Observation, first: Recognised) -> Recognised:
    """Recognise at the corrected goals; if there is no correction, the first is the last word."""
    made = correct(replace(seen, assembly=first.assembly), "contact")
    if not made.ok or made.covariance is None:
        return first
    corrected = replace(seen, goals=made.goals, covariance=floored(made.covariance))
    return recognise(corrected, first_seen=seen.goals)


def _contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}
