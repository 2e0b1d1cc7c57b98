"""Is the assembly right? A pure function of what was reached; it knows no plan, no corrector and no residual."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import final

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.judge_contacts import ContactVerdict, judged_contacts
from apo_bench.program import Reached, Snapshot
from apo_bench.thresholds import Thresholds

FAULTS = ("not_made", "gap", "overlap", "penetration", "pushed", "not_released", "not_at_rest")
"""What the judge can find, in the order in which it names one."""


@final
@dataclass(frozen=True)
class Verdict:
    """Whether an assembly succeeded, and every number the decision rests on."""

    success: bool
    """Strict: not one fault."""
    loose_success: bool
    """Every contact was made within millimetres and degrees; implied by `success`."""
    code: str
    """The first fault, or `ok`."""
    conditions: Mapping[str, bool]
    """Each of `FAULTS`, in that order: whether it was found."""
    contacts: tuple[ContactVerdict, ...]
    gap_mm: float | None
    """Worst |e| of all contacts; None if none could be measured, as for the numbers below."""
    angle_deg: float | None
    overlap: float | None
    penetration_mm: float | None
    pushed_mm: float | None
    """How far a part that was in place was pushed at most."""


def judge(
    assembly: Assembly, reached: Reached, reference: Array, thresholds: Thresholds, clearance_mm: float
) -> Verdict:
    """Judge every contact when it is made and, if it still stands, at the end; and every state for what is around it.

    Strict: at the corners of the overlap of the nominal faces |e| is at most the clearance plus a margin for fit
    contacts and `support_mm` for the others; the overlap is at least a part of the true one; no two geoms are too
    deep in each other; nothing holds a part; nothing moves; no part that was in place is pushed before it is moved
    again. Loose: only the contacts, within `loose_gap_mm` and `loose_angle_deg`, with the same overlap. The true
    overlap has a place on the environment face, so an assembly that is right in itself but stands elsewhere on the
    table is not what was shown; beyond that overlap, directions that no contact fixes decide nothing.

    Args:
        reached: Snapshots after each operation and at the end. One that is missing, or whose poses are not finite,
            fails the assembly.
        reference: (n, 4, 4), the true goals, world frame, [m]; they say how large an overlap should be.
        clearance_mm: Per side, of the parts that were used.
    """
    after, final = tuple(map(_sound, reached.after)), _sound(reached.final)
    contacts = judged_contacts(assembly, after, final, reference, thresholds, clearance_mm)
    states = [snapshot for snapshot in (*after, final) if snapshot is not None]
    pushes = [push * 1e3 for push in _pushes(assembly, after, final)]
    conditions = {
        "not_made": len(states) < len(after) + 1,
        "gap": any(not c.touching for c in contacts),
        "overlap": any(not c.covering for c in contacts),
        "penetration": any(not s.penetration_m * 1e3 <= thresholds.penetration_mm for s in states),
        "pushed": any(not push <= thresholds.pushed_mm for push in pushes),
        "not_released": any(not s.released for s in states),
        "not_at_rest": any(not _rests(s, thresholds) for s in states),
    }
    loose = not conditions["not_made"] and all(c.loose for c in contacts)
    return Verdict(
        success=loose and not any(conditions.values()),
        loose_success=loose,
        code=next((fault for fault, found in conditions.items() if found), "ok"),
        conditions=MappingProxyType(conditions),
        contacts=contacts,
        gap_mm=max((c.gap_mm for c in contacts if c.gap_mm is not None), default=None),
        angle_deg=max((c.angle_deg for c in contacts), default=None),
        overlap=min((c.overlap for c in contacts), default=None),
        penetration_mm=max((s.penetration_m * 1e3 for s in states), default=None),
        pushed_mm=max(pushes, default=None),
    )


def _sound(snapshot: Snapshot | None) -> Snapshot | None:
    """The snapshot, unless a pose in it is not finite."""
    if snapshot is None or not all(np.isfinite(T).all() for T in snapshot.poses.values()):
        return None
    return snapshot


def _rests(snapshot: Snapshot, thresholds: Thresholds) -> bool:
    slow = snapshot.speed_m_s * 1e3 < thresholds.rest_mm_s
    return slow and np.degrees(snapshot.spin_rad_s) < thresholds.rest_deg_s


def _pushes(assembly: Assembly, after: tuple[Snapshot | None, ...], final: Snapshot | None) -> Iterator[float]:
    """How far the centroid of each part lies, at each later moment, from where its last operation had put it, [m]."""
    put: dict[str, Array] = {}
    for k, snapshot in enumerate((*after, final)):
        moved = assembly.operations[k].moves if k < len(assembly) else ()
        for part in moved:
            put.pop(part, None)
        if snapshot is not None:
            at = {part: _centroid(assembly, part, snapshot) for part in (*put, *moved)}
            yield from (float(np.linalg.norm(at[part] - where)) for part, where in put.items())
            put.update({part: at[part] for part in moved})


def _centroid(assembly: Assembly, part: str, snapshot: Snapshot) -> Array:
    return pose.apply(snapshot.poses[part], assembly.solids[part].centroid[None])[0]
