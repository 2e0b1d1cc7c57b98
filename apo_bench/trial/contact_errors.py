"""The chance that a plan survives contacts that are wrong: one missing, one false, or one face elsewhere.

A missing contact shows if two faces without a contact nearly touch although nothing else puts them there. A false one,
or a face that lies elsewhere, shows in the residuals of the contacts at the observed poses, as far as others fix the
same directions. Each error has a prior probability, from the source of the contacts, and a likelihood. It also has a
truth, in which the plan is right or not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, final

import numpy as np
from scipy.special import ndtr

from apo_bench.assembly import (
    Assembly,
    Contact,
    Observation,
    OutlierModel,
    Poses,
    compute_deep_limit_mm,
    compute_placements,
    project_observation,
)
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.correction.contact.problem import seen_system
from apo_bench.correction.robust.beliefs import ROOM
from apo_bench.correction.robust.hypotheses import UNKNOWN, soft_deviation
from apo_bench.correction.solvers import factor_noise, linearise_by, unwhiten_twists
from apo_bench.geometry import Array, Face, pose
from apo_bench.perception.detection.candidate import make_candidate
from apo_bench.perception.detection.kalman_filter import PoseBelief
from apo_bench.perception.detection.thresholds import Rules, compute_contact_covariance
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.planning.prediction.rest_poses import is_insertion
from apo_bench.records import GIVEN, WRONG_CONTACTS, Thresholds, parse_face_offset
from apo_bench.trial.free_directions import FreeSpace


class ContactRates(NamedTuple):
    """The probability that one contact of an assembly is wrong in each way; the rest is that none is."""

    missing: float = 0.001
    """One is missing."""
    false: float = 0.001
    """One is between faces that do not touch."""
    shifted: float = 0.001
    """One face lies elsewhere than the model says."""
    offset_m: float = 3e-3
    """Standard deviation of that displacement, along the normal."""

    @property
    def none(self) -> float:
        """The probability that no contact is wrong."""
        return 1.0 - self.missing - self.false - self.shifted


UNKNOWN_SOURCE = ContactRates(0.3, 0.3, 0.3)
"""Of a source of contacts that states nothing."""
_SURE = 0.98
"""Probability of the error that a source is known to make."""
_RULES = Rules(miss_rate=1e-3)
"""Gaps and angles within which faces may be a missing contact."""
_FALSE_M = 8e-3
"""Standard deviation of the gap of faces that are taken for a contact."""
_FAR_M = 5e-2
"""The same of faces that are mistaken for others."""
_POINTS = np.array([-1.2, 0.0, 1.2])
"""Points that stand for a Gaussian, in standard deviations."""
_GUARDED = 0.5
"""A face stops a motion if the cosine of its normal with the line is larger: contact closes what gap the plan left."""
_RARE = 0.06
"""Probability of a robot with errors that nobody stated."""
_RARE_MM = 0.2
"""Standard deviation of these."""
_LEVER_M = 0.1
"""A rotation by an angle a moves points about a^2 times this beyond linear, [m]."""


def rates_of(contact_source: str) -> ContactRates:
    """The rates of a source of contacts, as records name it."""
    kind = contact_source.partition(":")[0]
    if kind == GIVEN:
        return ContactRates()
    if kind == "false-negative":
        return ContactRates(missing=_SURE)
    if kind == "false-positive":
        return ContactRates(false=_SURE)
    if kind in WRONG_CONTACTS:
        return ContactRates(shifted=_SURE, offset_m=1e-3 * parse_face_offset(contact_source))
    return UNKNOWN_SOURCE


class ContactError(NamedTuple):
    """One way in which the contacts may be wrong."""

    made: int
    """The operation that makes the contact, counted from 0."""
    contact: Contact
    log_weight: float
    """Log of prior probability times likelihood, up to a constant."""
    accepted: float
    """Probability that the judge accepts the gaps of all contacts in the plan."""
    pulled: Array | None = None
    """The residuals that are left, weighted, (3 c,), from which `ContactEvidence.truth` computes poses."""
    exists: bool = True
    """Whether these parts do touch there."""


def share_within(room_mm: Array | float, slack_mm: float) -> Array:
    """Probability that what is neglected stays within this room, any shape.

    Args:
        slack_mm: Its usual standard deviation; rarely it is `_RARE_MM`, since errors of robots are not always stated.
    """
    return np.asarray((1.0 - _RARE) * ndtr(room_mm / slack_mm) + _RARE * ndtr(room_mm / math.hypot(_RARE_MM, slack_mm)))


class Judged(NamedTuple):
    """What decides whether a gap of the plan fails it."""

    attach: Sequence[Attach]
    thresholds: Thresholds
    clearance_mm: float
    slack_mm: float
    """As of `share_within`."""

    def accepts(
        self, assembly: Assembly, made: int, contact: Contact, placed: Poses, main: Array, gap_m: Array
    ) -> Array:
        """Probability that a contact comes out right where the plan leaves a gap.

        Args:
            made: The operation that makes it.
            placed: Poses of all parts after the operation.
            main: Pose of its main part, (4, 4).
            gap_m: Any shape.
        """
        face = assembly.face_of(contact.environment)
        inserted = is_insertion(assembly, contact)
        if isinstance(face, Face):
            normal = placed[contact.environment.part][:3, :3] @ face.normal
            way = main[:3, :3] @ self.attach[made].direction
            if abs(normal @ way) >= _GUARDED or (abs(normal[2]) > _GUARDED and not inserted):
                return np.ones_like(gap_m)
        limits = self.thresholds
        # An insertion needs the play itself; the margin is for what is in place.
        margin_mm = 0.0 if inserted else limits.fit_margin_mm
        allowed = compute_deep_limit_mm(assembly, contact, self.clearance_mm, margin_mm, limits.support_mm)
        return share_within(allowed - 1e3 * np.abs(gap_m), self.slack_mm)


def missing_contacts(believed: Observation, space: FreeSpace, judged: Judged) -> Iterator[ContactError]:
    """Yield the contacts that may be missing, faces that nearly touch; their weights are relative to no error.

    Each of the stated contacts and one more is as likely to be the missing one.

    Args:
        space: Target poses of the plan, and the directions that the stated contacts leave free.
    """
    assembly = believed.assembly
    n = len(assembly)
    reach = space.twists.reshape(6 * n, -1)
    belief = PoseBelief(assembly, believed.start, space.poses, reach @ reach.T)
    standing = set(assembly.fixed)
    count = len(assembly.relations())
    bounds: Any = {"gap_m": _RULES.gap_m, "angle_rad": _RULES.angle_rad, "share": _RULES.share}
    for k, operation in enumerate(assembly.operations):
        now = belief.parts_after(k)
        for a in operation.moves:
            for b in sorted(standing - set(operation.moves)):
                J = now.reach[a] - now.reach[b]
                if not J.any():
                    continue
                for pair in find_facing_pairs(
                    assembly.solids[a], now.poses[a], assembly.solids[b], now.poses[b], **bounds
                ):
                    slope = pair.slope @ J
                    C = slope @ belief.covariance @ slope.T
                    found = make_candidate(believed, _RULES, a, b, now.poses[b], pair, slope, C)
                    if found is None or found.contact in operation.contacts:
                        continue
                    m = pair.lengths
                    S = (C + compute_contact_covariance(pair, assembly.play(found.contact, believed.play_m)))[:m, :m]
                    e = pair.residual[:m]
                    # likelihood of a closed pair over that of one anywhere within the bounds
                    scaled = 2.0 * np.pi * S / (2.0 * _RULES.gap_m) ** 2
                    likely = -0.5 * float(e @ np.linalg.solve(S, e) + np.linalg.slogdet(scaled)[1])
                    off = np.asarray(np.linalg.norm(e))
                    accepted = judged.accepts(assembly, k, found.contact, now.poses, space.poses[k], off)
                    yield ContactError(k, found.contact, likely - math.log(count + 1), float(accepted))
        standing |= set(operation.moves)


@final
class ContactEvidence:
    """The residuals of the stated contacts at the observed poses, linearised once, to compare errors of contacts.

    The residuals are Gaussian with covariance S, from noise and play. An error adds to S along what it may change.
    """

    def __init__(self, believed: Observation) -> None:
        self._seen = project_observation(believed)
        covariance = np.array(self._seen.covariance)
        unknown = [k for k, C in enumerate(covariance) if np.array_equal(C, UNKNOWN)]
        covariance[unknown] = ROOM
        self._system = seen_system(self._seen)
        self._L = factor_noise(replace(self._seen, covariance=covariance))
        self._e, self._Jt = linearise_by(self._system, self._seen.poses, self._L)
        turned = np.trace(covariance[:, 3:, 3:], axis1=1, axis2=2).min()  # of an operation that is no outlier
        soft = np.hypot(soft_deviation(self._seen), turned * _LEVER_M)
        self._S = self._Jt.T @ self._Jt + np.diag(soft * soft)

    @cached_property
    def _W(self) -> Array:
        return np.asarray(np.linalg.inv(self._S), dtype=np.float64)

    def log_density(self) -> float:
        """Log of the density of the residuals if no contact is wrong, up to a constant."""
        return -0.5 * float(self._e @ self._W @ self._e + np.linalg.slogdet(self._S)[1])

    def nearest(self) -> Array:
        """The likeliest true poses if no contact is wrong, (n, 4, 4)."""
        return self._at(self._W @ self._e)

    def truth(self, error: ContactError) -> Array:
        """The likeliest true poses if a contact is wrong in this way, (n, 4, 4)."""
        assert error.pulled is not None
        return self._at(error.pulled)

    def _at(self, pulled: Array) -> Array:
        return np.asarray(self._seen.poses @ pose.exp(unwhiten_twists(self._L, -self._Jt @ pulled)))

    def planned_m(self, poses: Array) -> Array:
        """The distance of the faces of each stated contact, (c,), at target poses, (n, 4, 4)."""
        e = self._system.residual(poses).reshape(-1, 3)
        u = self._system.points[..., 3]
        return np.asarray((e * u).sum(axis=-1) / np.maximum((u * u).sum(axis=-1), 1e-12))

    def accepted(self, poses: Array, judged: Judged) -> Array:
        """Probability that the judge accepts each stated contact at target poses, (c,)."""
        assembly = self._seen.assembly
        placed = compute_placements(assembly, self._seen.start, poses)
        every = zip(assembly.relations(), self.planned_m(poses), strict=True)
        return np.array(
            [
                float(judged.accepts(assembly, r.made, assembly.given(r.contact), placed[r.made], poses[r.made], gap))
                for r, gap in every
            ]
        )

    def errors(self, poses: Array, judged: Judged, rates: ContactRates) -> Iterator[ContactError]:
        """Yield the stated contacts that may be wrong: false, or with a face elsewhere.

        Args:
            poses: Target poses of the plan, (n, 4, 4).
        """
        assembly = self._seen.assembly
        relations = assembly.relations()
        base = self.log_density()
        pulled = self._W @ self._e
        placed = compute_placements(assembly, self._seen.start, poses)
        planned_m = self.planned_m(poses)
        accepted = self.accepted(poses, judged)
        for j, relation in enumerate(relations):
            rows = slice(3 * j, 3 * j + 3)
            u = self._system.points[..., j, :, 3].reshape(3)
            precision = float(u @ self._W[rows, rows] @ u)
            if precision <= 0.0:
                continue
            # What everything else says of the distance of these faces: Gaussian about x with variance v.
            x, v = float(u @ pulled[rows]) / precision, 1.0 / precision
            k = relation.made
            given = assembly.given(relation.contact)
            others = float(np.delete(accepted, j).prod())
            for prior, width, meets in (
                (rates.false / 2.0, _FALSE_M, False),
                (rates.false / 2.0, _FAR_M, False),
                (rates.shifted, rates.offset_m, True),
            ):
                total = v + width * width
                likely = 0.5 * x * x * (1.0 / v - 1.0 / total) + 0.5 * np.log(v / total)
                at = x * width * width / total  # the likeliest distance of the stated faces in truth
                accept = others
                if meets:
                    gaps = planned_m[j] - at + width * np.sqrt(v / total) * _POINTS
                    accept *= float(judged.accepts(assembly, k, given, placed[k], poses[k], gaps).mean())
                left = pulled - self._W[:, rows] @ u * at
                yield ContactError(k, given, float(base + np.log(prior / len(relations)) + likely), accept, left, meets)


def gross_errors(believed: Observation) -> Iterator[tuple[float, Array]]:
    """Yield for each operation the case that its observed pose says nothing: log weight and the likeliest true poses.

    The weight is as of `ContactEvidence.errors`.
    """
    rate = (believed.outliers or OutlierModel()).gross
    for k in range(len(believed.poses)):
        covariance = np.array(believed.covariance)
        covariance[k] += UNKNOWN
        evidence = ContactEvidence(replace(believed, covariance=covariance, shared=(), tails=None))
        yield evidence.log_density() + np.log(rate), evidence.nearest()
