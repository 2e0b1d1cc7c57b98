"""Whether the contacts of an assembly were made, measured on the nominal faces at the poses that were reached."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.overlap import NOTHING, Overlap, overlap
from apo_bench.placement import placed
from apo_bench.program import Poses, Snapshot
from apo_bench.thresholds import Thresholds

Moment = Literal["made", "end"]


class ContactVerdict(NamedTuple):
    """One contact at one moment."""

    contact: Contact
    operation: int
    """The operation that made it, counted from 0."""
    moment: Moment
    """`made`: when its operation was over; `end`: at the end, if nothing moved the parts away from each other."""
    gap_mm: float | None
    """Largest |e|: distance of a corner of the overlap to the plane of the other face; None without any overlap."""
    angle_deg: float
    """Between the normals of the faces; 0 if they look straight at each other."""
    overlap: float
    """How much of the true overlap is covered, at its place on the environment face; elsewhere does not count."""
    touching: bool
    """Strict in gap, loose in angle; faces that look at each other but do not overlap leave this open, as true."""
    covering: bool
    """There is an overlap, and it is large enough."""
    loose: bool

    @property
    def strict(self) -> bool:
        return self.touching and self.covering


def judged_contacts(
    assembly: Assembly,
    after: Sequence[Snapshot | None],
    final: Snapshot | None,
    reference: Array,
    thresholds: Thresholds,
    clearance_mm: float,
) -> tuple[ContactVerdict, ...]:
    """Every contact in the snapshot after its operation, and at the end if it still stands.

    Moments of which there is no snapshot are left out. Args as for `apo_bench.judge.judge`.
    """
    true = _true_overlaps(assembly, after, reference)
    out = []
    for k, (contact, made, lost) in enumerate(assembly.relations()):
        allowed = clearance_mm + thresholds.fit_margin_mm if assembly.is_fit(contact) else thresholds.support_mm
        plane, normal = assembly.face(contact.manipulated).plane, assembly.face(contact.environment).normal
        moments: Mapping[Moment, Snapshot | None] = {"made": after[made], "end": final if lost is None else None}
        for moment, snapshot in moments.items():
            if snapshot is not None:
                gap, angle, found = _measured(assembly, contact, plane, normal, snapshot.poses)
                share = found.share(true[k])
                turned = not angle <= thresholds.loose_angle_deg
                covering = gap is not None and share >= thresholds.overlap_fraction
                near = not turned and (gap is None or gap <= thresholds.loose_gap_mm)
                touching = near and (gap is None or gap <= allowed)
                loose = near and covering
                out.append(ContactVerdict(contact, made, moment, gap, angle, share, touching, covering, loose))
    return tuple(out)


def _true_overlaps(assembly: Assembly, after: Sequence[Snapshot | None], reference: Array) -> list[Overlap]:
    """The overlap of every contact when it is made at the true goals.

    A part that was not moved yet, fixed ones above all, counts as true where it stands in the first snapshot.
    """
    first = next((snapshot for snapshot in after if snapshot is not None), None)
    if first is None:
        return [NOTHING] * len(assembly.relations())
    history = placed(assembly, first.poses, reference)
    return [_overlap(assembly, contact, history[made]) for contact, made, _ in assembly.relations()]


def _measured(
    assembly: Assembly, contact: Contact, plane: Array, normal: Array, poses: Poses
) -> tuple[float | None, float, Overlap]:
    """Largest |e| [mm], angle between the normals [degrees], and the overlap.

    Args:
        plane: Of the manipulated face, (4,), in the frame of its part.
        normal: Of the environment face, (3,), in the frame of its part.
    """
    found = _overlap(assembly, contact, poses)
    T_m, T_e = poses[contact.manipulated.part], poses[contact.environment.part]
    n = T_m[:3, :3] @ plane[:3]
    angle = float(np.degrees(np.arccos(np.clip(-n @ T_e[:3, :3] @ normal, -1.0, 1.0))))
    if not found:
        return None, angle, found
    return float(np.abs((found.corners - T_m[:3, 3]) @ n + plane[3]).max()) * 1e3, angle, found


def _overlap(assembly: Assembly, contact: Contact, poses: Poses) -> Overlap:
    m, e = contact
    return overlap(assembly.face(m), poses[m.part], assembly.face(e), poses[e.part])
