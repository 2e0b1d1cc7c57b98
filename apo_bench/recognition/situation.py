"""Where operations put things: what is believed of all goals together, and what follows where some contacts hold.

The belief is a linear filter: contacts are measurements without noise but for play, taken one after the other. It
serves to tell which contacts go together; the correction itself is not its business. A situation says which faces may
touch, how sure that is, and what stands around.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import hypot, radians, sqrt
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Facing, Observation, PartFace, Poses, joint_covariance
from apo_bench.assembly.touching import facing
from apo_bench.geometry import Array, pose
from apo_bench.recognition.estimate import GoalEstimate
from apo_bench.recognition.thresholds import PairThresholds, Rules, pair_thresholds, reality, slack


class PartBeliefs(NamedTuple):
    """Every part after an operation."""

    poses: Poses
    reach: Mapping[str, Array]
    """Part -> (6, 6 n): the world twist (v, w), about the origin, that body twists of all goals make of its pose."""


@final
@dataclass(frozen=True, eq=False)
class Belief:
    """Goals with one covariance over all of them; the assembly gives who moves and who is carried, no contact."""

    assembly: Assembly
    start: Poses
    goals: Array
    """(n, 4, 4), world frame, [m]."""
    covariance: Array
    """(6 n, 6 n), of the body twists by which the goals are wrong, [m, rad]."""

    def standing(self, k: int) -> PartBeliefs:
        """Where every part is after operation k, counted from 0, and what errors of the goals do to it.

        With D' = T D_m^-1 D_s of a carried part, and exp(w) D a displaced D: w' = Ad(T) xi + Ad(T D_m^-1) (w_s - w_m).
        """
        n = len(self.goals)
        poses = dict(self.start)
        reach = {part: np.zeros((6, 6 * n)) for part in poses}
        for i, (operation, T) in enumerate(zip(self.assembly.operations[: k + 1], self.goals, strict=False)):
            # A body twist xi of goal T is the world twist Ad(T) xi; what is carried moves on as the main part does.
            own = np.zeros((6, 6 * n))
            own[:, 6 * i : 6 * i + 6] = pose.adjoint(T)
            by = T @ pose.inverse(poses[operation.main])
            for part in operation.carries:
                poses[part] = by @ poses[part]
                reach[part] = own + pose.adjoint(by) @ (reach[part] - reach[operation.main])
            poses[operation.main] = T
            reach[operation.main] = own
        return PartBeliefs(poses, reach)

    def conditioned(self, e: Array, J: Array, noise: Array) -> "Belief":
        """The belief after learning that some quantities, now e (r,) with derivative J (r, 6 n), are zero up to noise.

        Args:
            noise: (r, r), covariance of what the quantities really are.
        """
        # Kalman's update: K = P J^t (J P J^t + S)^-1, xi = -K e, P - K J P; symmetric again after rounding.
        PJ = self.covariance @ J.T
        K = np.linalg.solve(J @ PJ + noise, PJ.T).T
        covariance = self.covariance - K @ PJ.T
        goals = self.goals @ pose.exp(-(K @ e).reshape(-1, 6))
        return Belief(self.assembly, self.start, goals, (covariance + covariance.T) / 2)


def initial_belief(observation: Observation) -> Belief:
    """What an observation says before any contact is known."""
    covariance = joint_covariance(observation.goals, observation.covariance, observation.shared)
    return Belief(observation.assembly, observation.start, observation.goals, covariance)


_IMPLIED = 1.0
"""A contact that gains less by closing, in twice the logarithm, closes anyway if those before do."""
_FLAT_M = 0.2e-3
_FLAT_RAD = radians(0.3)
"""Gaps and tilts of so much say nothing of whether faces touch: what is linear here is not more exact."""

_LOOSE = PairThresholds(2e-3, radians(2.0))
"""Added to the bounds of two parts, since overlaps lie off their middles."""
_NARROW_M = 10e-3
"""Overlaps that parts with play may tilt in are about as narrow."""


class Candidate(NamedTuple):
    """A pair of faces that may touch."""

    contact: Contact
    pair: Facing
    slope: Array
    """(r, 6 n): derivative of its residual by body twists of all goals; r is 3 of flat faces."""
    noise: Array
    """(r, r): see `reality`."""
    most: PairThresholds
    distance: float
    """Squared Mahalanobis length of its residual."""
    gain: float
    """Twice the logarithm of how much likelier a closed pair is than one anywhere in the room that is left."""
    deviation_m: float
    """Of its gap."""
    normal: Array
    """Of the environment face, (3,), world; zero of round faces."""

    @property
    def implied(self) -> bool:
        """Whether it is no choice: where the contacts hold that were taken before, these faces touch."""
        return self.gain < _IMPLIED

    @property
    def parts(self) -> tuple[str, str]:
        """Manipulated, environment."""
        return self.contact.manipulated.part, self.contact.environment.part


def judged(
    seen: Observation, rules: Rules, a: str, b: str, T_b: Array, pair: Facing, slope: Array, C: Array
) -> Candidate | None:
    """A pair of faces of parts a and b as a candidate that gains nothing yet; None beyond the thresholds.

    Args:
        T_b: Where part b is, (4, 4), world, [m].
        slope: (r, 6 n): derivative of the residual by body twists of all goals.
        C: (r, r): covariance of the residual, from the goals alone.
    """
    contact = Contact(PartFace(a, pair.a), PartFace(b, pair.b))
    play_m = seen.assembly.play(contact, seen.play_m)
    noise = reality(pair, play_m)
    most = pair_thresholds(rules, C, slack(pair, play_m), pair.lengths)
    if abs(pair.gap_m) > most.gap_m or pair.angle_rad > most.angle_rad:
        return None
    # Squared Mahalanobis length: C is of the goals, noise of play and softness of a contact that is there.
    distance = float(pair.residual @ np.linalg.solve(C + noise, pair.residual))
    is_flat = not seen.assembly.is_round(contact)
    normal = T_b[:3, :3] @ seen.assembly.face(contact.environment).normal if is_flat else np.zeros(3)
    return Candidate(contact, pair, slope, noise, most, distance, 0.0, sqrt(C[0, 0] + noise[0, 0]), normal)


@final
@dataclass(frozen=True, eq=False)
class Situation:
    """The parts after operation k, the last of those that were estimated."""

    seen: Observation
    others: tuple[str, ...]
    """The parts that stand there, and are not moved by the operation."""
    estimate: GoalEstimate

    @property
    def k(self) -> int:
        """The operation, counted from 0."""
        return len(self.estimate.goals) - 1

    @property
    def moves(self) -> tuple[str, ...]:
        """The parts that it moved."""
        return self.seen.assembly.operations[self.k].moves

    @cached_property
    def now(self) -> PartBeliefs:
        """Where every part is, and what errors of the goals do to it."""
        known = self.estimate
        return Belief(known.assembly, self.seen.start, known.goals, known.covariance).standing(self.k)

    def pairs(self) -> Iterator[tuple[str, str]]:
        """A part that was moved and one that stands there, both where something was seen."""
        for a in self.moves:
            for b in self.others:
                if not self._reach(a, b).reshape(6, -1, 6)[:, ~self.seen.seen[: self.k + 1]].any():
                    yield a, b

    def variances(self, a: str, b: str, directions: Array, at: Array) -> Array:
        """How uncertain it is where a point of part a, at (3,), is beside part b along directions, (k, 3), [m^2]."""
        # A world twist (v, w) moves a point p by v + w x p, so along d by d . v + (p x d) . w.
        J = np.concatenate([directions, np.cross(at, directions)], axis=1) @ self._reach(a, b)
        return np.maximum(np.einsum("ki,ij,kj->k", J, self.estimate.covariance, J), 0.0)

    def middle(self, part: str) -> Array:
        """The middle of the box around a part, (3,), world, [m]."""
        return pose.apply(self.now.poses[part], self.seen.assembly.solids[part].bounds.mean(axis=0)[None])[0]

    def candidates(self, rules: Rules, taken: Collection[Contact]) -> tuple[Candidate, ...]:
        """The pairs of faces within the thresholds that were not taken yet."""
        candidates = list[Candidate]()
        for a, b in self.pairs():
            known = {(m.face, e.face) for m, e in taken if (m.part, e.part) == (a, b)}
            of_a = self.seen.assembly.solids[a]
            of_b = self.seen.assembly.solids[b]
            most = self._bounds(rules, a, b)
            bounds = {"gap_m": most.gap_m, "angle_rad": most.angle_rad, "share": rules.share}
            for pair in facing(of_a, self.now.poses[a], of_b, self.now.poses[b], **bounds, known=known):
                candidates += self._judged(rules, a, b, pair)
        return tuple(candidates)

    def _judged(self, rules: Rules, a: str, b: str, pair: Facing) -> Iterator[Candidate]:
        """The pair as a candidate, if it is one."""
        J = pair.slope @ self._reach(a, b)
        C = J @ self.estimate.covariance @ J.T
        candidate = judged(self.seen, rules, a, b, self.now.poses[b], pair, J, C)
        if candidate is not None:
            soft = candidate.noise + np.diag([_FLAT_M**2] * pair.lengths + [_FLAT_RAD**2] * (len(C) - pair.lengths))
            room = J @ self.estimate.room @ J.T
            gain = float(np.linalg.slogdet(room + soft)[1] - np.linalg.slogdet(C + soft)[1])
            yield candidate._replace(gain=gain)

    def _bounds(self, rules: Rules, a: str, b: str) -> PairThresholds:
        """No pair of faces of two parts has wider thresholds: those of the worst point in the worst direction."""
        at = self.middle(a)
        reach = self._reach(a, b)
        shifted = np.concatenate([reach[:3] + np.cross(reach[3:].T, at).T, reach[3:]])
        C = shifted @ self.estimate.covariance @ shifted.T
        shift, turn = (max(float(np.linalg.eigvalsh(block)[-1]), 0.0) for block in (C[:3, :3], C[3:, 3:]))
        boxes = [self.seen.assembly.solids[part].bounds for part in (a, b)]
        worst = np.diag(
            [shift + turn * min(float(np.linalg.norm(np.ptp(box, axis=0))) / 2 for box in boxes) ** 2, turn, turn]
        )
        play_m = self.seen.play_m
        loose = PairThresholds(_LOOSE.gap_m + play_m, _LOOSE.angle_rad + 2.0 * hypot(play_m, play_m) / _NARROW_M)
        return pair_thresholds(rules, worst, loose)

    def _reach(self, a: str, b: str) -> Array:
        """(6, 6 n): the world twist of part a beside part b that body twists of the goals make."""
        return self.now.reach[a] - self.now.reach[b]
