"""Detect contacts and estimate poses together: search the set of contacts with the highest posterior probability.

For each operation, a best-first search accepts or rejects pairs of faces that may touch, the most certain first. The
score of a set is the Bayes factor at its estimated poses (`estimate_poses`) plus penalties (surprise, -2 log of a prior
probability). Relations beyond the first and physical violations are penalised. The best few sets go on to the next
operation, which may change their order: a stick through two castles shows how the castles were stacked.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from math import exp, radians
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Contact, Observation, compute_placements
from apo_bench.geometry import Array
from apo_bench.perception.detection.candidate import Candidate
from apo_bench.perception.detection.evidence import (
    DetectedContacts,
    Rival,
    collect_evidence,
    keep_evident_contacts,
    remove_contacts,
)
from apo_bench.perception.detection.physical_penalties import (
    IMPOSSIBLE,
    compute_overlap_penalty,
    compute_physical_penalty,
    compute_refusal_penalty,
)
from apo_bench.perception.detection.pose_estimate import estimate_poses
from apo_bench.perception.detection.situation import Situation
from apo_bench.perception.detection.thresholds import Rules

GENEROUS_RULES = Rules(gap_m=50e-3, angle_rad=radians(45.0))
"""Wide bounds for candidates; the score decides which of them are contacts."""
_NEW_RELATION_PENALTY = 2.4
"""-2 log of how often faces that may touch do, beyond the relation by which a part rests: three in ten."""
_MOST_HISTORIES = 3
"""Sets that go on to the next operation, at most."""
_MOST_COMPLETE_SETS = 6
"""Complete sets of one operation, at most."""
_MOST_ESTIMATES = 50
"""Decisions in the search of one operation, at most."""
_LARGEST_SCORE_GAP = 12.0
"""A set that is worse than the best by more is dropped, in twice the log-likelihood."""
_NEGLIGIBLE = 16.0
"""The search ends at partial sets that discard more evidence than this plus the least physical surprise of a complete
set, in twice the log-likelihood."""


@check_arguments
def detect_contacts_jointly(observation: Observation, rules: Rules = GENEROUS_RULES) -> DetectedContacts:
    """Detect the face contacts of every operation together; those of the observation itself are ignored.

    Returns:
        The best set, with its posterior probability among those compared to the end, and the second best one.

    Raises:
        InputError: An argument has another type.
    """
    seen = remove_contacts(observation)
    kept = [_ContactHistory()]
    known = set(seen.assembly.fixed)
    for k, operation in enumerate(seen.assembly.operations):
        others = tuple(p for p in seen.assembly.solids if p in known - set(operation.moves))
        ended: dict[tuple[frozenset[Contact], ...], _ContactHistory] = {}
        for history in kept:
            for partial in _Search(seen, rules, k, others, history).list_complete_sets():
                longer = history.extend(partial)
                if longer.badness < ended.get(longer.key, _ContactHistory(badness=np.inf)).badness:
                    ended[longer.key] = longer
        ranked = sorted(ended.values(), key=lambda history: history.badness)
        kept = [
            history for history in ranked[:_MOST_HISTORIES] if history.badness <= ranked[0].badness + _LARGEST_SCORE_GAP
        ]
        known |= set(operation.moves)
    return _make_result(seen, kept)


@dataclass(frozen=True, eq=False)
class _ContactHistory:
    """The accepted contacts of the operations so far, with their poses and score."""

    taken: tuple[tuple[Candidate, ...], ...] = ()
    """Per operation."""
    poses: Array | None = None
    """(n, 4, 4), estimated poses of the n operations so far, world, [m]; None before the first."""
    surprise: float = 0.0
    """Sum of all penalties, -2 log of a prior probability."""
    badness: float = 0.0
    """-2 log of the posterior probability, up to a constant."""

    @cached_property
    def key(self) -> tuple[frozenset[Contact], ...]:
        """Its contacts per operation; histories with equal keys are the same."""
        return tuple(frozenset(c.contact for c in some) for some in self.taken)

    def extend(self, partial: "_PartialSet") -> "_ContactHistory":
        """The history extended by the contacts of the next operation."""
        return _ContactHistory(
            (*self.taken, partial.taken), partial.at.estimate.poses, partial.surprise, partial.badness
        )


class _PartialSet(NamedTuple):
    """A node of the search: some pairs of faces of one operation are accepted, some rejected, the others open."""

    at: Situation
    """Estimated poses with the accepted contacts."""
    taken: tuple[Candidate, ...]
    refused: frozenset[Contact]
    near: tuple[Candidate, ...]
    """Candidates that were not accepted, measured at the estimated poses."""
    surprise: float
    """Sum of the penalties of all operations so far."""

    @property
    def badness(self) -> float:
        """-2 log of the posterior probability of the contacts, up to a constant."""
        return self.at.estimate.badness + self.surprise


@dataclass(frozen=True, eq=False)
class _Search:
    """The best-first search for sets of contacts of operation k, after one history of earlier operations."""

    seen: Observation
    rules: Rules
    k: int
    others: tuple[str, ...]
    """Parts in place that the operation does not move."""
    history: _ContactHistory

    def list_complete_sets(self) -> Iterator[_PartialSet]:
        """Yield complete sets, to which no candidate can be added, in ascending order of discarded evidence.

        If there is none, yield the empty set with the penalty `IMPOSSIBLE`.
        """
        # A node of the queue: evidence that was discarded on its path, a number that breaks ties, the partial set.
        poses = self.seen.poses[self.k : self.k + 1]
        before = self.history.poses
        beginning = self._estimate_with_contacts((), poses if before is None else np.concatenate([before, poses]))
        waiting: list[tuple[float, int, _PartialSet]] = [(0.0, 0, beginning)]
        ended = 0
        steps = 0
        offence = IMPOSSIBLE
        while waiting and ended < _MOST_COMPLETE_SETS and steps < _MOST_ESTIMATES:
            lost, _, partial = heappop(waiting)
            if lost > _NEGLIGIBLE + offence:
                break
            while (best := self._find_most_certain(partial)) is not None:
                steps += 1
                if best.is_implied:  # no decision: accept all implied candidates at once
                    partial = self._accept_candidates(
                        partial, tuple(c for c in self._list_open_candidates(partial) if c.is_implied)
                    )
                    continue
                taking = self._accept_candidates(partial, (best,))
                refusing = partial._replace(refused=partial.refused | {best.contact})
                # A contact that forces the parts into each other is rejected without an alternative.
                if compute_overlap_penalty(taking.at, self.rules, taking.taken, *best.parts) >= IMPOSSIBLE:
                    partial = refusing
                    continue
                # The less likely decision is queued with the evidence that it discards, in twice the log-likelihood.
                # If touching is likelier (net below 0), rejecting discards -net, less the gain of the candidates that
                # accepting would rule out.
                net = (
                    best.distance
                    - best.gain
                    + self._new_relation_penalty(partial, best)
                    - compute_refusal_penalty(best, partial.near)
                )
                other, less = (
                    (taking, net)
                    if net > 0.0
                    else (refusing, max(0.0, self._lowest_excluded_score(partial, taking) - net))
                )
                heappush(waiting, (lost + less, steps, other))
                partial = refusing if net > 0.0 else taking
            # A set is contradictory if it rejects a contact that the accepted ones imply.
            if not any(c.is_implied and self._is_explained_by_noise(c) for c in partial.near):
                ended += 1
                offences = compute_physical_penalty(partial.at, self.rules, partial.taken, partial.near)
                offence = min(offence, offences)
                yield partial._replace(surprise=partial.surprise + offences)
        if not ended:
            yield beginning._replace(surprise=beginning.surprise + IMPOSSIBLE)

    def _list_open_candidates(self, partial: _PartialSet) -> list[Candidate]:
        """The candidates that are not decided yet and whose residual the noise explains."""
        return [c for c in partial.near if c.contact not in partial.refused and self._is_explained_by_noise(c)]

    def _is_explained_by_noise(self, c: Candidate) -> bool:
        """True if the noise explains the residual of the pair (chi-square test)."""
        return c.distance <= self.rules.largest_explained(len(c.pair.residual))

    def _find_most_certain(self, partial: _PartialSet) -> Candidate | None:
        """The open candidate that is most certain to touch; None if none is open."""
        return min(self._list_open_candidates(partial), key=lambda c: (c.distance - c.gain, c.contact), default=None)

    def _lowest_excluded_score(self, partial: _PartialSet, taking: _PartialSet) -> float:
        """The lowest distance less gain of the open candidates that accepting one more contact rules out; at most 0.

        Args:
            taking: `partial` with the contact accepted.
        """
        left = {c.contact for c in (*self._list_open_candidates(taking), *taking.taken)}
        return min([0.0, *(c.distance - c.gain for c in self._list_open_candidates(partial) if c.contact not in left)])

    def _new_relation_penalty(self, partial: _PartialSet, c: Candidate) -> float:
        """The penalty of a contact that relates two more parts: `_NEW_RELATION_PENALTY`, or 0 for the first
        relation."""
        related = {before.parts for before in partial.taken}
        return _NEW_RELATION_PENALTY if related and c.parts not in related else 0.0

    def _accept_candidates(self, partial: _PartialSet, some: tuple[Candidate, ...]) -> _PartialSet:
        """The partial set with some candidates accepted; implied ones cost no penalty."""
        rare = sum(self._new_relation_penalty(partial, c) for c in some if not c.is_implied)
        return self._estimate_with_contacts(
            (*partial.taken, *some), partial.at.estimate.poses, partial.refused, partial.surprise + rare
        )

    def _estimate_with_contacts(
        self,
        taken: tuple[Candidate, ...],
        begin: Array,
        refused: frozenset[Contact] = frozenset(),
        surprise: float | None = None,
    ) -> _PartialSet:
        """Estimate the poses for a set of contacts, and measure the remaining candidates there.

        Args:
            taken: Accepted contacts of operation k.
            begin: (k + 1, 4, 4), initial poses of the estimation.
            surprise: Sum of penalties; None: that of the history.
        """
        sets = (*self.history.taken, taken)
        at = Situation(
            self.seen, self.others, estimate_poses(self.seen, _make_partial_assembly(self.seen.assembly, sets), begin)
        )
        near = at.list_candidates(self.rules, [c.contact for c in taken])
        return _PartialSet(at, taken, refused, near, self.history.surprise if surprise is None else surprise)


def _make_partial_assembly(assembly: Assembly, sets: tuple[tuple[Candidate, ...], ...]) -> Assembly:
    """The assembly of the first `len(sets)` operations, with these contacts per operation."""
    operations = tuple(
        replace(operation, contacts=tuple(c.contact for c in taken))
        for operation, taken in zip(assembly.operations, sets, strict=False)
    )
    return replace(assembly, operations=operations)


def _make_result(seen: Observation, kept: list[_ContactHistory]) -> DetectedContacts:
    """Make the result from the histories that remain, sorted best first."""
    weights = [exp(-0.5 * (history.badness - kept[0].badness)) for history in kept]
    likely = [weight / sum(weights) for weight in weights]
    is_uncorrected = compute_placements(seen.assembly, seen.start, seen.poses)
    evidence = [
        [
            each
            for k, (taken, poses) in enumerate(zip(history.taken, is_uncorrected, strict=True))
            for each in collect_evidence(
                seen.assembly, k, [(c.contact, c.pair, c.largest_distance) for c in taken], poses
            )
        ]
        for history in kept[:2]
    ]
    rival = Rival(keep_evident_contacts(seen.assembly, evidence[1]), likely[1]) if len(kept) > 1 else None
    return DetectedContacts(keep_evident_contacts(seen.assembly, evidence[0]), tuple(evidence[0]), likely[0], rival)
