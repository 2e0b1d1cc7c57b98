"""Detect which face touches which, from solids, observed poses and their stated noise (Section 1, first half).

For each operation, the detector compares faces of the moved parts with faces of the parts already in place. A pair is a
candidate if its normals are opposite within an angle, its gap is small and its overlap large enough. Noise moves whole
parts, so the contacts of an operation are not judged independently. The detector takes the likeliest candidate, updates
the poses as if it closed, and measures the others again. If candidates remain, it also tries other first candidates and
keeps the likeliest set (joint compatibility: Neira and Tardos, "Data association in stochastic mapping using the joint
compatibility test", 2001).
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Contact, FacingPair, Observation, compute_placements
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import Array
from apo_bench.perception.detection.candidate import Candidate, make_candidate
from apo_bench.perception.detection.evidence import (
    DetectedContacts,
    Evidence,
    collect_evidence,
    keep_evident_contacts,
    remove_contacts,
)
from apo_bench.perception.detection.kalman_filter import PartBeliefs, PoseBelief, make_initial_belief
from apo_bench.perception.detection.thresholds import RULES_BY_NOISE, Rules

_FIRST_CANDIDATES = 12
"""Largest number of candidates that are tried as the first contact of an operation."""


@check_arguments
def detect_contacts(observation: Observation, rules: Rules = RULES_BY_NOISE) -> DetectedContacts:
    """Detect the face contacts of every operation from the observed poses.

    The contacts of the observation itself are ignored. Each operation is tested for contacts of the parts that it moves
    with the parts that it does not move, so carried parts keep their contacts. Operations that were not observed, and
    those that depend on them, make no contact.

    Args:
        observation: From `observe` or `read_observation`.
        rules: Thresholds. Default: those that follow from the stated noise.

    Returns:
        The observation with the detected contacts, and the evidence for each.

    Raises:
        InputError: An argument has another type.
    """
    observation = remove_contacts(observation)
    assembly = observation.assembly
    belief = make_initial_belief(observation)
    evidence = list[Evidence]()
    is_uncorrected = compute_placements(assembly, observation.start, belief.poses)
    standing = set(assembly.fixed)
    for k, (operation, poses) in enumerate(zip(assembly.operations, is_uncorrected, strict=True)):
        others = tuple(p for p in assembly.solids if p in standing - set(operation.moves))
        around = _OperationSearch(observation, rules, k, others)
        best = around.find_likeliest_set(belief)
        belief = best.belief
        evidence += collect_evidence(assembly, k, [(c.contact, c.pair, c.largest_distance) for c in best.taken], poses)
        standing |= set(operation.moves)
    return DetectedContacts(keep_evident_contacts(assembly, evidence), tuple(evidence))


class _ContactSet(NamedTuple):
    """A set of jointly compatible contacts of one operation."""

    taken: tuple[Candidate, ...]
    """In the order in which they were taken."""
    belief: PoseBelief
    """The poses after all taken contacts."""
    score: float
    """Sum over the taken contacts of squared Mahalanobis length less gain (see `_log_likelihood_gain`); lower is
    better."""
    left: tuple[Contact, ...]
    """Candidates before the first contact that were not taken."""


@dataclass(frozen=True, eq=False)
class _OperationSearch:
    """One operation and the parts around it: searches the likeliest set of contacts."""

    seen: Observation
    rules: Rules
    k: int
    """The operation, counted from 0."""
    others: tuple[str, ...]
    """Parts in place that the operation does not move."""

    def list_candidates(self, belief: PoseBelief, taken: Collection[Contact] = ()) -> tuple[Candidate, ...]:
        """The pairs within the thresholds that were not taken yet, the likeliest first."""
        # Squared lengths are compared per residual, scaled to the 3 residuals of flat faces.
        now = belief.parts_after(self.k)
        solids = self.seen.assembly.solids
        rules = self.rules
        bounds = {"gap_m": rules.gap_m, "angle_rad": rules.angle_rad, "share": rules.share}
        list_candidates = list[Candidate]()
        for a in self.seen.assembly.operations[self.k].moves:
            for b in self.others:
                known = {(m.face, e.face) for m, e in taken if (m.part, e.part) == (a, b)}
                for pair in find_facing_pairs(solids[a], now.poses[a], solids[b], now.poses[b], **bounds, known=known):
                    list_candidates += self._make_candidates(a, b, pair, now, belief)
        return tuple(sorted(list_candidates, key=lambda c: (c.distance * (3 / len(c.pair.residual)), c.contact)))

    def find_likeliest_set(self, belief: PoseBelief) -> _ContactSet:
        """The set of contacts with the lowest score, over all first candidates that are tried."""
        best = self._extend_set(belief, None)
        for first in best.left[:_FIRST_CANDIDATES]:
            other = self._extend_set(belief, first)
            if other.score < best.score:
                best = other
        return best

    def _extend_set(self, belief: PoseBelief, first: Contact | None) -> _ContactSet:
        """Take candidates one by one, the likeliest first, and update the poses after each.

        Args:
            first: The contact to take first; None: the likeliest.
        """
        at_first = at_hand = self.list_candidates(belief)
        taken = list[Candidate]()
        total = 0.0
        while at_hand:
            chosen = next((c for c in at_hand if c.contact == first), at_hand[0])
            if chosen.distance > self.rules.largest_explained(len(chosen.pair.residual)):
                break
            belief = belief.update(chosen.pair.residual, chosen.jacobian, chosen.noise)
            taken.append(chosen)
            total += chosen.distance - chosen.gain
            at_hand = self.list_candidates(belief, [c.contact for c in taken])
        have = {c.contact for c in taken}
        return _ContactSet(tuple(taken), belief, total, tuple(c.contact for c in at_first if c.contact not in have))

    def _make_candidates(
        self, a: str, b: str, pair: FacingPair, now: PartBeliefs, belief: PoseBelief
    ) -> Iterator[Candidate]:
        """Yield the pair as a candidate; nothing if it exceeds the thresholds or depends on an unobserved pose."""
        # Body twists of all poses -> world twist of part a relative to part b -> gap and tilts of the pair.
        slope = pair.slope @ (now.reach[a] - now.reach[b])
        if slope.reshape(len(slope), -1, 6)[:, ~self.seen.observed].any():
            return
        C = slope @ belief.covariance @ slope.T
        candidate = make_candidate(self.seen, self.rules, a, b, now.poses[b], pair, slope, C)
        if candidate is not None:
            yield candidate._replace(gain=_log_likelihood_gain(C, candidate.noise, self.rules, pair.lengths))


def _log_likelihood_gain(C: Array, noise: Array, rules: Rules, lengths: int) -> float:
    """Twice the log-likelihood ratio of a closed pair to one anywhere within the bounds, for a zero residual.

    The sum of log((range)^2 / (2 pi variance)) over the independent axes of the residual, negative terms left out.
    An axis that earlier contacts already fix gains nothing.

    Args:
        C: (r, r), covariance of the residual from the poses.
        noise: (r, r), covariance of the residual of a true contact.
        lengths: How many of the r rows are lengths; the others are angles.
    """
    # After scaling by the range, the eigenvectors of C are independent axes. An axis along which the poses are at least
    # as certain as a contact is exact was decided by earlier contacts.
    span = np.array([2 * rules.gap_m] * lengths + [2 * rules.angle_rad] * (len(C) - lengths))
    variance, V = np.linalg.eigh(C / np.outer(span, span))
    real = np.einsum("ij,ik,kj->j", V, noise / np.outer(span, span), V)
    new = variance > real
    return float(np.maximum(-np.log(2 * np.pi * (variance + real)[new]), 0.0).sum())
