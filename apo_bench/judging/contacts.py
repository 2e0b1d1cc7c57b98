"""Measure the contacts of an assembly on the nominal faces at the poses that were reached."""

import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactKind,
    Meeting,
    Meetings,
    Poses,
    classify_contact,
    compute_apart_limit_mm,
    compute_deep_limit_mm,
)
from apo_bench.geometry import Array, Mate, Overlap, compute_shares
from apo_bench.records import Thresholds

ContactMoment = Literal["made", "end"]
_OFF: dict[ContactKind, str] = {
    "plane on plane": "off by {:.2f} mm",
    "shaft in hole": "{:.2f} mm off the axis",
    "shaft on plane": "off by {:.2f} mm",
    "cone in cone": "{:.2f} mm off its seat",
    "cone on rim": "{:.2f} mm off its seat",
}


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


class ContactCase(NamedTuple):
    """A contact to be judged at one moment."""

    contact: Contact
    operation: int
    """That makes it, counted from 0."""
    moment: ContactMoment
    poses: Poses
    """Where the parts are, world frame, [m]."""
    true: Poses
    """Where they are when it is made, if all goals are the true ones."""
    anywhere: bool = False
    """Whether the area of the overlap alone counts, wherever on the environment face it is."""


class ContactJudge(NamedTuple):
    """The limits of a contact, at any moment."""

    known: Meetings
    """The contacts, with what is measured already."""
    thresholds: Thresholds
    clearance_mm: float

    def verdicts(self, cases: Sequence[ContactCase]) -> tuple[ContactVerdict, ...]:
        """Measure contacts, all in one call."""
        found = self.known.measure((c.contact, poses) for c in cases for poses in (c.poses, c.true))
        common = [each.common if isinstance(each, Mate) else each for each in found]
        shares = compute_covered_shares(common[::2], common[1::2], [case.anywhere for case in cases])
        return tuple(self._verdict(*each) for each in zip(cases, found[::2], shares.tolist(), strict=True))

    def _verdict(self, case: ContactCase, lie: Meeting, covered: float) -> ContactVerdict:
        limits = self.thresholds
        contact = case.contact
        gaps, angle = _measure(self.known.assembly, contact, case.poses, lie)
        allowed, gap = self._nearest_limit(case, gaps)
        covering = gap is not None and covered >= limits.overlap_fraction
        near = angle <= limits.loose_angle_deg and (gap is None or gap <= limits.loose_gap_mm)
        return ContactVerdict(
            contact,
            case.operation,
            case.moment,
            gap_mm=gap,
            angle_deg=angle,
            overlap=covered,
            touching=near and (gap is None or gap <= allowed),
            covering=covering,
            loose=near and covering,
            allowed_mm=allowed,
            kind=classify_contact(*map(self.known.assembly.face_of, contact)) or "plane on plane",
        )

    def _nearest_limit(self, case: ContactCase, gaps: Gaps | None) -> tuple[float, float | None]:
        """How large a gap may be and how large it is, [mm], on the side, apart or deep, that is nearer its limit."""
        lengths = self.clearance_mm, self.thresholds.fit_margin_mm, self.thresholds.support_mm
        deep = compute_deep_limit_mm(self.known.assembly, case.contact, *lengths)
        # faces may be farther apart than deep, so the smaller gap of the two needs no other limit
        if gaps is None or gaps.apart_mm <= gaps.deep_mm:
            return deep, None if gaps is None else gaps.deep_mm
        apart = compute_apart_limit_mm(self.known.assembly, case.contact, case.operation, case.true, *lengths)
        return max((deep, gaps.deep_mm), (apart, gaps.apart_mm), key=lambda side: side[1] - side[0])


def faults_in_words(contacts: Sequence[ContactVerdict], thresholds: Thresholds) -> Iterator[tuple[str, str]]:
    """`gap` and `overlap`, each with what is wrong at the worst contact, if there is anything."""
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


def compute_covered_shares(reached: Sequence[Overlap], true: Sequence[Overlap], anywhere: Sequence[bool]) -> Array:
    """How much of each true overlap is covered by the one that was reached, (k,), 0 to 1; 1 where the true is empty.

    Args:
        anywhere: Where the areas alone are compared, as in `ContactCase`.
    """
    area, whole = (np.array([overlap.area for overlap in of]) for of in (reached, true))
    out = np.minimum(1.0, np.divide(area, whole, out=np.ones(len(whole)), where=whole > 0.0))
    placed = [i for i, at_all in enumerate(anywhere) if not at_all]
    out[placed] = compute_shares([reached[i] for i in placed], [true[i] for i in placed])
    return out


def _when(verdict: ContactVerdict) -> str:
    return f" after operation {verdict.operation + 1}" if verdict.moment == "made" else ""


def _measure(assembly: Assembly, contact: Contact, poses: Poses, lie: Meeting) -> tuple[Gaps | None, float]:
    """What is between the faces, and the angle between the normals or axes [degrees].

    Round faces are off, not apart or deep.
    """
    if isinstance(lie, Mate):
        off = 1e3 * lie.gap_m
        return Gaps(off, off) if lie.common else None, math.degrees(lie.angle_rad)
    plane = assembly.face(contact.manipulated).plane
    normal = assembly.face(contact.environment).normal
    T_m = poses[contact.manipulated.part]
    T_e = poses[contact.environment.part]
    n = T_m[:3, :3] @ plane[:3]
    angle = math.degrees(math.acos(min(1.0, max(-1.0, float(-n @ T_e[:3, :3] @ normal)))))
    if not lie:
        return None, angle
    # Seen from the manipulated face, a corner on the plane of the other one is in front of it where the two are apart.
    e = 1e3 * ((lie.corners - T_m[:3, 3]) @ n + plane[3])
    return Gaps(max(0.0, float(e.max())), max(0.0, float(-e.min()))), angle
