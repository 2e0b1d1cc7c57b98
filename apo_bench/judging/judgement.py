"""The result of one rule of judging: its faults, and the numbers behind them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import final

import numpy as np

from apo_bench.assembly import (
    Snapshot,
)
from apo_bench.judging.contact_limits import ContactVerdict, list_contact_faults
from apo_bench.records import Thresholds

FAULTS = ("not_made", "gap", "overlap", "penetration", "pushed", "not_released", "not_at_rest")
"""Codes of faults, by precedence: the first that occurs is named."""


@final
@dataclass(frozen=True)
class Judgement:
    """The faults of an assembly by one rule."""

    loose: bool
    """Every operation ended, and every required contact holds within the loose limits."""
    conditions: Mapping[str, bool]
    """Each of `FAULTS`, in that order -> whether it occurs."""
    why: str
    """The first fault in words, such as the contact and its gap; empty without details."""
    contacts: tuple[ContactVerdict, ...]
    gap_mm: float | None
    """Worst |e| of all contacts; None if none could be measured, as for the numbers below."""
    angle_deg: float | None
    overlap: float | None
    penetration_mm: float | None
    placed_part_shift_mm: float | None
    """Largest displacement of a placed part in the world, even if this rule does not limit it.

    The rule for the finished assembly limits other lengths: relative motion of movable parts, and this displacement for
    parts that fixed parts locate.
    """

    @property
    def holds(self) -> bool:
        """Whether there is no fault."""
        return self.loose and not any(self.conditions.values())

    @property
    def code(self) -> str:
        """The first fault, or `ok`."""
        return next((fault for fault, is_there in self.conditions.items() if is_there), "ok")


def make_judgement(
    contacts: tuple[ContactVerdict, ...],
    states: Sequence[Snapshot],
    pushes: Sequence[tuple[str, float]],
    thresholds: Thresholds,
    *,
    all_made: bool,
    disturbed: Sequence[float] | None = None,
) -> Judgement:
    """Compare measurements with the thresholds.

    Args:
        contacts: The contacts that the rule requires.
        states: The snapshots in which nothing may penetrate, be held or move.
        pushes: Part and its displacement [mm], as the rule limits it.
        all_made: Whether every operation ended and there is a snapshot of the end.
        disturbed: Displacements of parts in the world [mm], if `list_pushes` are other lengths.
    """
    # `not x <= limit` also fails a value that is not a number.
    conditions = {
        "not_made": not all_made,
        "gap": any(not c.touching for c in contacts),
        "overlap": any(not c.covering for c in contacts),
        "penetration": any(not s.penetration_m * 1e3 <= thresholds.penetration_mm for s in states),
        "pushed": any(not push <= thresholds.placed_part_shift_mm for _, push in pushes),
        "not_released": any(not s.released for s in states),
        "not_at_rest": any(not _is_at_rest(s, thresholds) for s in states),
    }
    first = next((fault for fault, is_there in conditions.items() if is_there), "ok")
    return Judgement(
        loose=all_made and all(c.loose for c in contacts),
        conditions=MappingProxyType(conditions),
        why=_describe_fault(first, contacts, states, pushes, thresholds),
        contacts=contacts,
        gap_mm=max((c.gap_mm for c in contacts if c.gap_mm is not None), default=None),
        angle_deg=max((c.angle_deg for c in contacts), default=None),
        overlap=min((c.overlap for c in contacts), default=None),
        penetration_mm=max((s.penetration_m * 1e3 for s in states), default=None),
        placed_part_shift_mm=max((push for _, push in pushes) if disturbed is None else disturbed, default=None),
    )


def _describe_fault(
    fault: str,
    contacts: tuple[ContactVerdict, ...],
    states: Sequence[Snapshot],
    pushes: Sequence[tuple[str, float]],
    thresholds: Thresholds,
) -> str:
    """The fault in words; empty for faults without details."""
    if fault in ("gap", "overlap"):
        return dict(list_contact_faults(contacts, thresholds))[fault]
    if fault == "penetration":
        deepest = max(s.penetration_m * 1e3 for s in states)
        return f"{deepest:.2f} mm deep, where {thresholds.penetration_mm:g} mm are allowed"
    if fault == "pushed":
        part, push = max(pushes, key=lambda found: found[1])
        return f"{part} by {push:.2f} mm, where {thresholds.placed_part_shift_mm:g} mm are allowed"
    return ""


def _is_at_rest(snapshot: Snapshot, thresholds: Thresholds) -> bool:
    """Whether the parts of a snapshot are at rest."""
    slow = snapshot.speed_m_s * 1e3 < thresholds.rest_mm_s
    return slow and np.degrees(snapshot.spin_rad_s) < thresholds.rest_deg_s
