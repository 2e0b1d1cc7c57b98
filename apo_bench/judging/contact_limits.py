"""Measure the contacts of an assembly, on nominal faces at the reached poses, and compare them with their limits."""

import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactKind,
    ContactMeasurements,
    OverlapOrMate,
    Poses,
    classify_contact,
    compute_apart_limit_mm,
    compute_deep_limit_mm,
)
from apo_bench.geometry import Array, Mate, Overlap, compute_shares
from apo_bench.records import Thresholds

ContactMoment = Literal["made", "end"]
# Kind of contact -> its gap in words.
_GAP_TEXTS: dict[ContactKind, str] = {
    "plane on plane": "off by {:.2f} mm",
    "shaft in hole": "{:.2f} mm off the axis",
    "shaft on plane": "off by {:.2f} mm",
    "cone in cone": "{:.2f} mm off its seat",
    "cone on rim": "{:.2f} mm off its seat",
}


class Gaps(NamedTuple):
    """The largest distance and the largest penetration of two faces, [mm]; not negative."""

    apart_mm: float
    deep_mm: float


class ContactVerdict(NamedTuple):
    """The measurements and verdicts of one contact at one moment."""

    contact: Contact
    operation: int
    """The operation that made it, counted from 0."""
    moment: ContactMoment
    """`made`: when its operation was over; `end`: at the end, if nothing moved the parts away from each other."""
    gap_mm: float | None
    """Largest |e|; None without any overlap.

    For flat faces, the distance of an overlap corner to the other plane. For round faces, the distance of the axes at
    the ends of their common length (`Mate.gap_m`). If faces may be farther apart than deep, the |e| that exceeds its
    limit the most.
    """
    angle_deg: float
    """Between the axes, or between one normal and the opposite of the other; 0 for parallel faces."""
    overlap: float
    """Share of the true overlap, or of the true common length, that is covered, 0 to 1."""
    touching: bool
    """Gap within the strict limit and angle within the loose one; true for parallel faces without overlap."""
    covering: bool
    """The faces overlap, by the required share."""
    loose: bool
    """Gap and angle within the loose limits, and `covering`."""
    allowed_mm: float
    """The largest gap that counts as touching."""
    kind: ContactKind = "plane on plane"

    @property
    def strict(self) -> bool:
        return self.touching and self.covering


class ContactCase(NamedTuple):
    """A contact to judge at one moment."""

    contact: Contact
    operation: int
    """The operation that makes the contact, counted from 0."""
    moment: ContactMoment
    poses: Poses
    """The reached poses of the parts, world frame, [m]."""
    true: Poses
    """The true poses of the parts when the contact is made."""
    anywhere: bool = False
    """Whether only the area of the overlap counts, not its position on the environment face."""


class ContactJudge(NamedTuple):
    """The limits by which contacts are judged, at any moment."""

    known: ContactMeasurements
    """Cache of measured contacts."""
    thresholds: Thresholds
    clearance_mm: float

    def verdicts(self, cases: Sequence[ContactCase]) -> tuple[ContactVerdict, ...]:
        """The verdicts on contacts, in the order of the cases, measured in one call."""
        # Two measurements per case: reached (even indices), true (odd indices).
        found = self.known.measure((c.contact, poses) for c in cases for poses in (c.poses, c.true))
        common = [each.common if isinstance(each, Mate) else each for each in found]
        # even: reached, odd: true
        shares = compute_covered_shares(common[::2], common[1::2], [case.anywhere for case in cases])
        return tuple(self._verdict(*each) for each in zip(cases, found[::2], shares.tolist(), strict=True))

    def _verdict(self, case: ContactCase, lie: OverlapOrMate, covered: float) -> ContactVerdict:
        """The verdict on one contact.

        Args:
            lie: The contact as measured at the reached poses.
            covered: Share of the true overlap that is covered.
        """
        limits = self.thresholds
        contact = case.contact
        gaps, angle = _measure_contact(self.known.assembly, contact, case.poses, lie)
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
        """(limit, gap), [mm], of the side, apart or deep, that exceeds its limit more; gap None without an overlap."""
        lengths = self.clearance_mm, self.thresholds.fit_margin_mm, self.thresholds.support_mm
        deep = compute_deep_limit_mm(self.known.assembly, case.contact, *lengths)
        # The limit for faces apart is never smaller than that for faces deep.
        if gaps is None or gaps.apart_mm <= gaps.deep_mm:
            return deep, None if gaps is None else gaps.deep_mm
        apart = compute_apart_limit_mm(self.known.assembly, case.contact, case.operation, case.true, *lengths)
        return max((deep, gaps.deep_mm), (apart, gaps.apart_mm), key=lambda side: side[1] - side[0])


def list_contact_faults(contacts: Sequence[ContactVerdict], thresholds: Thresholds) -> Iterator[tuple[str, str]]:
    """Pairs of fault code (`gap`, `overlap`) and sentence about the worst contact, for each fault that occurs."""
    apart = [c for c in contacts if not c.touching]
    if apart:
        # An angle beyond its limit is worse than any gap.
        worst = max(apart, key=lambda c: (c.angle_deg > thresholds.loose_angle_deg, c.gap_mm or 0.0))
        if worst.gap_mm is None or worst.angle_deg > thresholds.loose_angle_deg:
            how = f"turned by {worst.angle_deg:.1f} deg, where {thresholds.loose_angle_deg:g} deg are allowed"
        else:
            gap = _GAP_TEXTS[worst.kind].format(worst.gap_mm)
            how = f"{gap}, where {round(worst.allowed_mm, 2):g} mm are allowed"
        yield "gap", f"{worst.contact} is {how}{_describe_moment(worst)}"
    bare = [c for c in contacts if not c.covering]
    if bare:
        worst = min(bare, key=lambda c: c.overlap)
        true = "length" if worst.kind in ("shaft in hole", "cone in cone", "shaft on plane") else "overlap"
        how = (
            f"{100 * worst.overlap:.0f} % of the true {true}, where {100 * thresholds.overlap_fraction:g} % are needed"
        )
        yield "overlap", f"{worst.contact} covers {how}{_describe_moment(worst)}"


def compute_covered_shares(reached: Sequence[Overlap], true: Sequence[Overlap], anywhere: Sequence[bool]) -> Array:
    """The share of each true overlap that the reached one covers, (k,), 0 to 1; 1 if the true overlap is empty.

    Args:
        anywhere: Per contact, whether only areas are compared, as in `ContactCase`.
    """
    area, whole = (np.array([overlap.area for overlap in of]) for of in (reached, true))
    out = np.minimum(1.0, np.divide(area, whole, out=np.ones(len(whole)), where=whole > 0.0))
    placed = [i for i, at_all in enumerate(anywhere) if not at_all]
    out[placed] = compute_shares([reached[i] for i in placed], [true[i] for i in placed])
    return out


def _describe_moment(verdict: ContactVerdict) -> str:
    return f" after operation {verdict.operation + 1}" if verdict.moment == "made" else ""


def _measure_contact(
    assembly: Assembly, contact: Contact, poses: Poses, lie: OverlapOrMate
) -> tuple[Gaps | None, float]:
    """The gaps of a contact (None without overlap), and the angle between normals or axes [degrees].

    The offset of round faces counts both as distance and as penetration.

    Args:
        lie: The contact as measured by `ContactMeasurements`.
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
    # Signed distance of the overlap corners, which lie on the environment face, from the plane of the manipulated
    # face: positive where the faces are apart.
    e = 1e3 * ((lie.corners - T_m[:3, 3]) @ n + plane[3])
    return Gaps(max(0.0, float(e.max())), max(0.0, float(-e.min()))), angle
