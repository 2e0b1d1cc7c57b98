"""Measure the contacts of an assembly on the nominal faces at the poses that were reached."""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactKind,
    Poses,
    classify_contact,
    compute_apart_limit_mm,
    compute_deep_limit_mm,
)
from apo_bench.geometry import Face, Mate, Overlap, compute_overlap, measure_mate
from apo_bench.records import Thresholds

ContactMoment = Literal["made", "end"]
_OFF: dict[ContactKind, str] = {
    "plane on plane": "off by {:.2f} mm",
    "shaft in hole": "{:.2f} mm off the axis",
    "shaft on plane": "off by {:.2f} mm",
    "cone in cone": "{:.2f} mm off its seat",
    "cone on rim": "{:.2f} mm off its seat",
}
Share = Callable[[Overlap, Overlap], float]
"""How much of the true overlap (the second) is covered by the one that was reached (the first), 0 to 1."""


class Gaps(NamedTuple):
    """How far two faces are apart and how deep in each other where they are most, [mm]; not negative."""

    apart_mm: float
    deep_mm: float


class ContactVerdict(NamedTuple):
    """One contact at one moment."""

    contact: Contact
    operation: int
    """The operation that made it, counted from 0."""
    moment: ContactMoment
    """`made`: when its operation was over; `end`: at the end, if nothing moved the parts away from each other."""
    gap_mm: float | None
    """Largest |e|: distance of a corner of the overlap to the plane of the other face; of round faces that of the
    axes, at the ends of their common length (`Mate.gap_m`); None without any overlap. Where faces may be farther apart
    than deep, |e| where it exceeds what is allowed the most."""
    angle_deg: float
    """Between the normals of the faces, or between the axes; 0 if they look straight at each other."""
    overlap: float
    """How much of the true overlap, or of the true common length, is covered."""
    touching: bool
    """Strict in gap, loose in angle; faces that look at each other but do not overlap leave this open, as true."""
    covering: bool
    """There is an overlap, and it is large enough."""
    loose: bool
    allowed_mm: float
    """The largest gap that counts as touching."""
    kind: ContactKind = "plane on plane"

    @property
    def strict(self) -> bool:
        return self.touching and self.covering


class ContactJudge(NamedTuple):
    """The limits of a contact, at any moment."""

    assembly: Assembly
    thresholds: Thresholds
    clearance_mm: float

    def verdict(
        self, contact: Contact, operation: int, moment: ContactMoment, poses: Poses, true: Poses, share: Share
    ) -> ContactVerdict:
        """Measure one contact.

        Args:
            operation: That makes it, counted from 0.
            poses: Where the parts are, world frame, [m].
            true: Where they are when it is made, if all goals are the true ones.
        """
        limits = self.thresholds
        gaps, angle, common = _measure(self.assembly, contact, poses)
        allowed, gap = self._nearest_limit(contact, operation, true, gaps)
        covered = share(common, face_overlap(self.assembly, contact, true))
        covering = gap is not None and covered >= limits.overlap_fraction
        near = angle <= limits.loose_angle_deg and (gap is None or gap <= limits.loose_gap_mm)
        return ContactVerdict(
            contact,
            operation,
            moment,
            gap_mm=gap,
            angle_deg=angle,
            overlap=covered,
            touching=near and (gap is None or gap <= allowed),
            covering=covering,
            loose=near and covering,
            allowed_mm=allowed,
            kind=classify_contact(*map(self.assembly.face_of, contact)) or "plane on plane",
        )

    def _nearest_limit(
        self, contact: Contact, operation: int, true: Poses, gaps: Gaps | None
    ) -> tuple[float, float | None]:
        """How large a gap may be and how large it is, [mm], on the side, apart or deep, that is nearer its limit."""
        lengths = self.clearance_mm, self.thresholds.fit_margin_mm, self.thresholds.support_mm
        deep = compute_deep_limit_mm(self.assembly, contact, *lengths)
        if gaps is None:
            return deep, None
        apart = compute_apart_limit_mm(self.assembly, contact, operation, true, *lengths)
        return max((deep, gaps.deep_mm), (apart, gaps.apart_mm), key=lambda side: side[1] - side[0])


def faults_in_words(contacts: Sequence[ContactVerdict], thresholds: Thresholds) -> Iterator[tuple[str, str]]:
    """`gap` and `compute_overlap`, each with what is wrong at the worst contact, if there is anything."""
    apart = [c for c in contacts if not c.touching]
    if apart:
        worst = max(apart, key=lambda c: (c.angle_deg > thresholds.loose_angle_deg, c.gap_mm or 0.0))
        if worst.gap_mm is None or worst.angle_deg > thresholds.loose_angle_deg:
            how = f"turned by {worst.angle_deg:.1f} deg, where {thresholds.loose_angle_deg:g} deg are allowed"
        else:
            how = f"{_OFF[worst.kind].format(worst.gap_mm)}, where {round(worst.allowed_mm, 2):g} mm are allowed"
        yield "gap", f"{worst.contact} is {how}{_when(worst)}"
    bare = [c for c in contacts if not c.covering]
    if bare:
        worst = min(bare, key=lambda c: c.overlap)
        true = "length" if worst.kind in ("shaft in hole", "cone in cone", "shaft on plane") else "overlap"
        how = (
            f"{100 * worst.overlap:.0f} % of the true {true}, where {100 * thresholds.overlap_fraction:g} % are needed"
        )
        yield "overlap", f"{worst.contact} covers {how}{_when(worst)}"


def face_overlap(assembly: Assembly, contact: Contact, poses: Poses) -> Overlap:
    """The overlap of the two faces of a contact; nothing, if they do not look at each other."""
    if assembly.is_round(contact):
        return _mate(assembly, contact, poses).common
    m, e = contact
    at = (np.ascontiguousarray(poses[end.part], dtype=np.float64).tobytes() for end in contact)
    return _overlap(assembly.face(m), assembly.face(e), *at)


@lru_cache(maxsize=512)
def _overlap(m: Face, e: Face, at_m: bytes, at_e: bytes) -> Overlap:
    """Remembered, since all trials of a seed share the true ones: two megabytes at most."""
    T_m, T_e = (np.frombuffer(at).reshape(4, 4) for at in (at_m, at_e))
    return compute_overlap(m, T_m, e, T_e)


def _mate(assembly: Assembly, contact: Contact, poses: Poses) -> Mate:
    m, e = contact
    return measure_mate(assembly.face_of(m), poses[m.part], assembly.face_of(e), poses[e.part])


def _when(verdict: ContactVerdict) -> str:
    return f" after operation {verdict.operation + 1}" if verdict.moment == "made" else ""


def _measure(assembly: Assembly, contact: Contact, poses: Poses) -> tuple[Gaps | None, float, Overlap]:
    """What is between the faces, angle between the normals or axes [degrees], and the overlap.

    Round faces are off, not apart or deep, but for shafts on planes.
    """
    if assembly.is_round(contact):
        between = _mate(assembly, contact, poses)
        off = 1e3 * between.gap_m
        return Gaps(off, off) if between.common else None, float(np.degrees(between.angle_rad)), between.common
    plane = assembly.face(contact.manipulated).plane
    normal = assembly.face(contact.environment).normal
    common = face_overlap(assembly, contact, poses)
    T_m = poses[contact.manipulated.part]
    T_e = poses[contact.environment.part]
    n = T_m[:3, :3] @ plane[:3]
    angle = float(np.degrees(np.arccos(np.clip(-n @ T_e[:3, :3] @ normal, -1.0, 1.0))))
    if not common:
        return None, angle, common
    # Seen from the manipulated face, a corner on the plane of the other one is in front of it where the two are apart.
    e = 1e3 * ((common.corners - T_m[:3, 3]) @ n + plane[3])
    return Gaps(max(0.0, float(e.max())), max(0.0, float(-e.min()))), angle, common
