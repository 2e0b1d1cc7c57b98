"""The estimated situation after an operation under assumed contacts: poses, uncertainties, further candidates."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from math import hypot, radians
from typing import final

import numpy as np

from apo_bench.assembly import Contact, FacingPair, Observation
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import Array, pose
from apo_bench.perception.detection.candidate import Candidate, make_candidate
from apo_bench.perception.detection.kalman_filter import PartBeliefs, PoseBelief
from apo_bench.perception.detection.pose_estimate import PoseEstimate
from apo_bench.perception.detection.thresholds import PairThresholds, Rules, compute_pair_thresholds

_FLAT_M = 0.2e-3
"""Standard deviation of a gap from the error of linearisation; smaller gaps are no evidence."""
_FLAT_RAD = radians(0.3)
"""Standard deviation of a tilt from the error of linearisation."""
_LOOSE = PairThresholds(2e-3, radians(2.0))
"""Added to the bounds of two parts, because overlaps lie off the middles of the parts."""
_NARROW_M = 10e-3
"""Assumed width of an overlap, for the tilt that play allows."""


@final
@dataclass(frozen=True, eq=False)
class Situation:
    """The parts after operation k, the last operation of an estimate."""

    seen: Observation
    others: tuple[str, ...]
    """Parts in place that the operation does not move."""
    estimate: PoseEstimate

    @property
    def k(self) -> int:
        """The operation, counted from 0."""
        return len(self.estimate.poses) - 1

    @property
    def moves(self) -> tuple[str, ...]:
        """The parts that operation k moves."""
        return self.seen.assembly.operations[self.k].moves

    @cached_property
    def poses_now(self) -> PartBeliefs:
        """Poses of all parts after operation k, and their Jacobians by errors of the estimated poses."""
        known = self.estimate
        return PoseBelief(known.assembly, self.seen.start, known.poses, known.covariance).parts_after(self.k)

    def list_part_pairs(self) -> Iterator[tuple[str, str]]:
        """Yield each moved part with each part in place, unless their relative pose depends on an unobserved pose."""
        for a in self.moves:
            for b in self.others:
                if not self._relative_jacobian(a, b).reshape(6, -1, 6)[:, ~self.seen.observed[: self.k + 1]].any():
                    yield a, b

    def point_variances(self, a: str, b: str, directions: Array, at: Array) -> Array:
        """Variances (k,) of the position of a point of part a relative to part b, [m^2].

        Args:
            directions: (k, 3), unit vectors along which the position is taken, world.
            at: (3,), the point, world, [m].
        """
        # A world twist (v, w) moves a point p by v + w x p, so along d by d . v + (p x d) . w.
        J = np.concatenate([directions, np.cross(at, directions)], axis=1) @ self._relative_jacobian(a, b)
        return np.maximum(np.einsum("ki,ij,kj->k", J, self.estimate.covariance, J), 0.0)

    def box_center(self, part: str) -> Array:
        """The centre of the bounding box of a part, (3,), world, [m]."""
        return pose.apply(self.poses_now.poses[part], self.seen.assembly.solids[part].bounds.mean(axis=0)[None])[0]

    def list_candidates(self, rules: Rules, taken: Collection[Contact]) -> tuple[Candidate, ...]:
        """The pairs of faces within the thresholds that were not taken yet."""
        list_candidates = list[Candidate]()
        for a, b in self.list_part_pairs():
            known = {(m.face, e.face) for m, e in taken if (m.part, e.part) == (a, b)}
            of_a = self.seen.assembly.solids[a]
            of_b = self.seen.assembly.solids[b]
            most = self._bound_thresholds(rules, a, b)
            bounds = {"gap_m": most.gap_m, "angle_rad": most.angle_rad, "share": rules.share}
            for pair in find_facing_pairs(
                of_a, self.poses_now.poses[a], of_b, self.poses_now.poses[b], **bounds, known=known
            ):
                list_candidates += self._make_candidates(rules, a, b, pair)
        return tuple(list_candidates)

    def _make_candidates(self, rules: Rules, a: str, b: str, pair: FacingPair) -> Iterator[Candidate]:
        """Yield the pair as a candidate with its gain; nothing if it exceeds the thresholds."""
        J = pair.slope @ self._relative_jacobian(a, b)
        C = J @ self.estimate.covariance @ J.T
        candidate = make_candidate(self.seen, rules, a, b, self.poses_now.poses[b], pair, J, C)
        if candidate is not None:
            soft = candidate.noise + np.diag([_FLAT_M**2] * pair.lengths + [_FLAT_RAD**2] * (len(C) - pair.lengths))
            room = J @ self.estimate.room @ J.T
            gain = float(np.linalg.slogdet(room + soft)[1] - np.linalg.slogdet(C + soft)[1])
            yield candidate._replace(gain=gain)

    def _bound_thresholds(self, rules: Rules, a: str, b: str) -> PairThresholds:
        """An upper bound of the thresholds of all pairs of faces of two parts.

        It combines the least certain direction at the middle of part a with the turn over half the smaller diagonal.
        """
        at = self.box_center(a)
        reach = self._relative_jacobian(a, b)
        shifted = np.concatenate([reach[:3] + np.cross(reach[3:].T, at).T, reach[3:]])
        C = shifted @ self.estimate.covariance @ shifted.T
        shift, turn = (max(float(np.linalg.eigvalsh(block)[-1]), 0.0) for block in (C[:3, :3], C[3:, 3:]))
        boxes = [self.seen.assembly.solids[part].bounds for part in (a, b)]
        worst = np.diag(
            [shift + turn * min(float(np.linalg.norm(np.ptp(box, axis=0))) / 2 for box in boxes) ** 2, turn, turn]
        )
        play_m = self.seen.play_m
        loose = PairThresholds(_LOOSE.gap_m + play_m, _LOOSE.angle_rad + 2.0 * hypot(play_m, play_m) / _NARROW_M)
        return compute_pair_thresholds(rules, worst, loose)

    def _relative_jacobian(self, a: str, b: str) -> Array:
        """(6, 6 n): Jacobian of the world twist of part a relative to part b by the body twists of the poses."""
        return self.poses_now.reach[a] - self.poses_now.reach[b]
