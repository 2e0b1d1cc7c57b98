"""Detect contacts and estimate poses together: of many sets of contacts the one that explains the poses best.

Operation by operation, pairs of faces that may touch are taken or refused, the surest first; each set is scored with
the poses that it asks for (`estimate`), by how much better it explains what was observed than chance does, less what it
takes for granted: relations beyond the first, and what physics forbids. The best few sets go on to the next operation,
which may turn the order round: a stick that fits through two castles says how these were stacked.
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
from apo_bench.perception.detection.estimate import estimate
from apo_bench.perception.detection.evidence import (
    DetectedContacts,
    Rival,
    collect_evidence,
    keep_evident_contacts,
    without_contacts,
)
from apo_bench.perception.detection.physics import IMPOSSIBLE, inside, physical_surprise, refusal
from apo_bench.perception.detection.situation import Situation
from apo_bench.perception.detection.thresholds import Rules

GENEROUS_RULES = Rules(gap_m=50e-3, angle_rad=radians(45.0))
"""What is looked at; what is a contact the score says."""
_RELATION = 2.4
"""-2 log of how often faces that may touch do, beyond the relation by which a part rests: three in ten."""
_KEPT = 3
_ENDINGS = 6
_SITUATIONS = 50
"""Sets that go on to the next operation; sets of one operation that are followed to the end, and steps of that."""
_HOPELESS = 12.0
_LOST = 16.0
"""A set is given up that is worse than the best by so much, in twice the logarithm; and one that throws so much
evidence away, beyond what physics says against the best."""


@check_arguments
def detect_contacts_jointly(observation: Observation, rules: Rules = GENEROUS_RULES) -> DetectedContacts:
    """Detect the face contacts of every operation together; those of the observation itself are ignored.

    Returns:
        The best set, with how likely it is among those that were compared to the end, and the next best one.

    Raises:
        InputError: Something else was given.
    """
    seen = without_contacts(observation)
    kept = [_History()]
    known = set(seen.assembly.fixed)
    for k, operation in enumerate(seen.assembly.operations):
        others = tuple(p for p in seen.assembly.solids if p in known - set(operation.moves))
        ended: dict[tuple[frozenset[Contact], ...], _History] = {}
        for history in kept:
            for partial in _Search(seen, rules, k, others, history).endings():
                longer = history.follow(partial)
                if longer.badness < ended.get(longer.key, _History(badness=np.inf)).badness:
                    ended[longer.key] = longer
        ranked = sorted(ended.values(), key=lambda history: history.badness)
        kept = [history for history in ranked[:_KEPT] if history.badness <= ranked[0].badness + _HOPELESS]
        known |= set(operation.moves)
    return _recognised(seen, kept)


@dataclass(frozen=True, eq=False)
class _History:
    """The contacts of the operations so far, and what comes of them."""

    taken: tuple[tuple[Candidate, ...], ...] = ()
    poses: Array | None = None
    surprise: float = 0.0
    badness: float = 0.0

    @cached_property
    def key(self) -> tuple[frozenset[Contact], ...]:
        """What makes it another one."""
        return tuple(frozenset(c.contact for c in some) for some in self.taken)

    def follow(self, partial: "_Partial") -> "_History":
        """With one operation more."""
        return _History((*self.taken, partial.taken), partial.at.estimate.poses, partial.surprise, partial.badness)


class _Partial(NamedTuple):
    """Some pairs of faces of one operation taken, some refused."""

    at: Situation
    taken: tuple[Candidate, ...]
    refused: frozenset[Contact]
    near: tuple[Candidate, ...]
    """Those that were not taken, where the taken ones put the parts."""
    surprise: float
    """What all contacts so far take for granted."""

    @property
    def badness(self) -> float:
        """-2 log of how likely the contacts are, but for a constant."""
        return self.at.estimate.badness + self.surprise


@dataclass(frozen=True, eq=False)
class _Search:
    """The sets of one operation after a history."""

    seen: Observation
    rules: Rules
    k: int
    others: tuple[str, ...]
    history: _History

    def endings(self) -> Iterator[_Partial]:
        """Sets to which nothing can be added, first where least evidence is thrown away; none at the worst."""
        poses = self.seen.poses[self.k : self.k + 1]
        before = self.history.poses
        beginning = self._with((), poses if before is None else np.concatenate([before, poses]))
        waiting: list[tuple[float, int, _Partial]] = [(0.0, 0, beginning)]
        ended = 0
        steps = 0
        offence = IMPOSSIBLE
        while waiting and ended < _ENDINGS and steps < _SITUATIONS:
            lost, _, partial = heappop(waiting)
            if lost > _LOST + offence:
                break
            while (best := self._likeliest(partial)) is not None:
                steps += 1
                if best.implied:
                    partial = self._taking(partial, tuple(c for c in self._open(partial) if c.implied))
                    continue
                taking = self._taking(partial, (best,))
                refusing = partial._replace(refused=partial.refused | {best.contact})
                if inside(taking.at, self.rules, taking.taken, *best.parts) >= IMPOSSIBLE:
                    partial = refusing
                    continue
                # What is thrown away where the other way is gone, in twice the logarithm: if touching is likelier (net
                # below 0), refusing loses -net, less what one more contact would put out of the question.
                net = best.distance - best.gain + self._rare(partial, best) - refusal(best, partial.near)
                other, less = (taking, net) if net > 0.0 else (refusing, max(0.0, self._rival(partial, taking) - net))
                heappush(waiting, (lost + less, steps, other))
                partial = refusing if net > 0.0 else taking
            if not any(c.implied and self._agrees(c) for c in partial.near):
                ended += 1
                offences = physical_surprise(partial.at, self.rules, partial.taken, partial.near)
                offence = min(offence, offences)
                yield partial._replace(surprise=partial.surprise + offences)
        if not ended:
            yield beginning._replace(surprise=beginning.surprise + IMPOSSIBLE)

    def _open(self, partial: _Partial) -> list[Candidate]:
        return [c for c in partial.near if c.contact not in partial.refused and self._agrees(c)]

    def _agrees(self, c: Candidate) -> bool:
        """Whether the noise explains that they do not look closed."""
        return c.distance <= self.rules.most_of(len(c.pair.residual))

    def _likeliest(self, partial: _Partial) -> Candidate | None:
        """The pair that is surest to touch, of those that are neither taken nor refused."""
        return min(self._open(partial), key=lambda c: (c.distance - c.gain, c.contact), default=None)

    def _rival(self, partial: _Partial, taking: _Partial) -> float:
        """What the best of the pairs predicts that one more contact puts out of the question, at most 0."""
        left = {c.contact for c in (*self._open(taking), *taking.taken)}
        return min([0.0, *(c.distance - c.gain for c in self._open(partial) if c.contact not in left)])

    def _rare(self, partial: _Partial, c: Candidate) -> float:
        """What it takes for granted that this pair touches, in addition to those that were taken."""
        related = {before.parts for before in partial.taken}
        return _RELATION if related and c.parts not in related else 0.0

    def _taking(self, partial: _Partial, some: tuple[Candidate, ...]) -> _Partial:
        rare = sum(self._rare(partial, c) for c in some if not c.implied)
        return self._with((*partial.taken, *some), partial.at.estimate.poses, partial.refused, partial.surprise + rare)

    def _with(
        self,
        taken: tuple[Candidate, ...],
        begin: Array,
        refused: frozenset[Contact] = frozenset(),
        surprise: float | None = None,
    ) -> _Partial:
        """The set with the poses that it asks for, and what is near there."""
        sets = (*self.history.taken, taken)
        at = Situation(self.seen, self.others, estimate(self.seen, _first(self.seen.assembly, sets), begin))
        near = at.candidates(self.rules, [c.contact for c in taken])
        return _Partial(at, taken, refused, near, self.history.surprise if surprise is None else surprise)


def _first(assembly: Assembly, sets: tuple[tuple[Candidate, ...], ...]) -> Assembly:
    """The first operations, with these contacts."""
    operations = tuple(
        replace(operation, contacts=tuple(c.contact for c in taken))
        for operation, taken in zip(assembly.operations, sets, strict=False)
    )
    return replace(assembly, operations=operations)


def _recognised(seen: Observation, kept: list[_History]) -> DetectedContacts:
    """The best of the histories, with how likely it is, and the next best one."""
    weights = [exp(-0.5 * (history.badness - kept[0].badness)) for history in kept]
    likely = [weight / sum(weights) for weight in weights]
    is_uncorrected = compute_placements(seen.assembly, seen.start, seen.poses)
    evidence = [
        [
            each
            for k, (taken, poses) in enumerate(zip(history.taken, is_uncorrected, strict=True))
            for each in collect_evidence(seen.assembly, k, [(c.contact, c.pair, c.most) for c in taken], poses)
        ]
        for history in kept[:2]
    ]
    rival = Rival(keep_evident_contacts(seen.assembly, evidence[1]), likely[1]) if len(kept) > 1 else None
    return DetectedContacts(keep_evident_contacts(seen.assembly, evidence[0]), tuple(evidence[0]), likely[0], rival)
