"""What one rule of judging finds: the faults, and every number they rest on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import final

import numpy as np

from apo_bench.assembly import (
    Snapshot,
)
from apo_bench.judging.contacts import ContactVerdict, faults_in_words
from apo_bench.records import Thresholds

FAULTS = ("not_made", "gap", "overlap", "penetration", "pushed", "not_released", "not_at_rest")
"""What the judge can find, in the order in which it names one."""


@final
@dataclass(frozen=True)
class Judgement:
    """The faults of an assembly by one rule."""

    loose: bool
    """Every operation ended, and every needed contact is there within millimetres and degrees."""
    conditions: Mapping[str, bool]
    """Each of `FAULTS`, in that order: whether it was found."""
    why: str
    """What is wrong by the first fault: which contact and how many mm, say; empty where nothing is."""
    contacts: tuple[ContactVerdict, ...]
    gap_mm: float | None
    """Worst |e| of all contacts; None if none could be measured, as for the numbers below."""
    angle_deg: float | None
    overlap: float | None
    penetration_mm: float | None
    placed_part_shift_mm: float | None
    """How far a part that was in place was moved in the room at most, whether or not this rule minds. The finished
    assembly is judged by other lengths: how far movable parts slid on each other, and this one of parts in a mate of a
    fixed part."""

    @property
    def holds(self) -> bool:
        """Not one fault."""
        return self.loose and not any(self.conditions.values())

    @property
    def code(self) -> str:
        """The first fault, or `ok`."""
        return next((fault for fault, is_there in self.conditions.items() if is_there), "ok")


def judgement(
    contacts: tuple[ContactVerdict, ...],
    states: Sequence[Snapshot],
    pushes: Sequence[tuple[str, float]],
    thresholds: Thresholds,
    *,
    all_made: bool,
    disturbed: Sequence[float] | None = None,
) -> Judgement:
    """Compare what was measured with the thresholds.

    Args:
        contacts: The contacts that the rule needs.
        states: The snapshots in which nothing may be inside anything, held or moving.
        pushes: Part, and how far it was pushed [mm], by what the rule minds.
        all_made: Whether every operation ended and there is a snapshot of the end.
        disturbed: How far parts were pushed [mm], if that is not the same.
    """
    conditions = {
        "not_made": not all_made,
        "gap": any(not c.touching for c in contacts),
        "overlap": any(not c.covering for c in contacts),
        "penetration": any(not s.penetration_m * 1e3 <= thresholds.penetration_mm for s in states),
        "pushed": any(not push <= thresholds.placed_part_shift_mm for _, push in pushes),
        "not_released": any(not s.released for s in states),
        "not_at_rest": any(not _rests(s, thresholds) for s in states),
    }
    first = next((fault for fault, is_there in conditions.items() if is_there), "ok")
    return Judgement(
        loose=all_made and all(c.loose for c in contacts),
        conditions=MappingProxyType(conditions),
        why=_why(first, contacts, states, pushes, thresholds),
        contacts=contacts,
        gap_mm=max((c.gap_mm for c in contacts if c.gap_mm is not None), default=None),
        angle_deg=max((c.angle_deg for c in contacts), default=None),
        overlap=min((c.overlap for c in contacts), default=None),
        penetration_mm=max((s.penetration_m * 1e3 for s in states), default=None),
        placed_part_shift_mm=max((push for _, push in pushes) if disturbed is None else disturbed, default=None),
    )


def _why(
    fault: str,
    contacts: tuple[ContactVerdict, ...],
    states: Sequence[Snapshot],
    pushes: Sequence[tuple[str, float]],
    thresholds: Thresholds,
) -> str:
    if fault in ("gap", "overlap"):
        return dict(faults_in_words(contacts, thresholds))[fault]
    if fault == "penetration":
        deepest = max(s.penetration_m * 1e3 for s in states)
        return f"{deepest:.2f} mm deep, where {thresholds.penetration_mm:g} mm are allowed"
    if fault == "pushed":
        part, push = max(pushes, key=lambda found: found[1])
        return f"{part} by {push:.2f} mm, where {thresholds.placed_part_shift_mm:g} mm are allowed"
    return ""


def _rests(snapshot: Snapshot, thresholds: Thresholds) -> bool:
    slow = snapshot.speed_m_s * 1e3 < thresholds.rest_mm_s
    return slow and np.degrees(snapshot.spin_rad_s) < thresholds.rest_deg_s
