"""Which face touches which, from what was seen: solids, poses and their stated noise (Section 1, first half).

Operation by operation, faces of the parts that moved are held against faces of the parts that stand there. A pair is a
candidate if its normals are opposite within an angle, its gap is small and its overlap large enough. Noise moves whole
parts, so the contacts of an operation are not judged one by one: the likeliest is believed, the goals are put where
that one closes, and the others are looked at from there. Where that leaves candidates over, other beginnings are tried
and the likeliest set wins (joint compatibility: Neira and Tardos, "Data association in stochastic mapping using the
joint compatibility test", 2001).
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly.facing import Facing, face_gap, facing
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly, Contact, PartFace
from apo_bench.errors import InputError, kind
from apo_bench.geometry.arrays import Array
from apo_bench.recognition.belief import Belief, PartBeliefs, initial_belief
from apo_bench.recognition.thresholds import RULES_BY_NOISE, PairThresholds, Rules, pair_thresholds, reality, slack

_BEGINNINGS = 12
"""Candidates that are tried as the first of an operation, at most."""


@final
@dataclass(frozen=True)
class Evidence:
    """Why a contact is believed: what was measured when it was taken, and what was allowed."""

    contact: Contact
    made: int
    """The operation that made it, counted from 0."""
    gap_m: float
    """Above 0 apart, below 0 inside each other, where the contacts taken before put the parts."""
    angle_rad: float
    share: float
    """Overlap over the smaller face."""
    most: PairThresholds
    """The thresholds."""
    seen_gap_m: float
    """The gap at the goals as they were seen."""


class Rival(NamedTuple):
    """The next best set of contacts, where several were compared."""

    assembly: Assembly
    probability: float


@final
@dataclass(frozen=True, eq=False)
class Recognised:
    """The assembly with the contacts that were recognised, all of them asked to coincide."""

    assembly: Assembly
    evidence: tuple[Evidence, ...]
    """One for each contact, in the order of `assembly.relations()`."""
    probability: float | None = None
    """Of the set among those that were compared to the end; None where sets are not compared."""
    rival: Rival | None = None


def recognise(
    observation: Observation, rules: Rules = RULES_BY_NOISE, *, first_seen: Array | None = None
) -> Recognised:
    """Find the face contacts of every operation; those that the observation came with are not looked at.

    Only what an operation puts somewhere is held against what it does not move, so parts that are carried keep the
    contacts among themselves. Operations that were not seen, and what depends on them, make no contact.

    Args:
        rules: `RULES_BY_NOISE` or `FIXED_RULES` of `apo_bench.recognition.thresholds`, or your own.
        first_seen: (n, 4, 4), the goals that the evidence calls seen, where those of the observation were corrected
            already.

    Raises:
        InputError: Something else was given.
    """
    observation = without_contacts(observation, rules, "recognise")
    assembly = observation.assembly
    bare = observation.assembly.operations
    belief = initial_belief(observation)
    evidence = list[Evidence]()
    as_seen = belief if first_seen is None else replace(belief, goals=first_seen)
    known = set(assembly.fixed)
    for k, operation in enumerate(bare):
        around = _Around(observation, rules, k, tuple(p for p in assembly.solids if p in known - set(operation.moves)))
        found = around.fixed(belief) if rules.fixed else around.likeliest(belief)
        belief = found.belief
        evidence += around.evidence(found, as_seen.standing(k))
        known |= set(operation.moves)
    made = [tuple(e.contact for e in evidence if e.made == k) for k in range(len(bare))]
    operations = tuple(replace(operation, contacts=made[k]) for k, operation in enumerate(bare))
    return Recognised(replace(assembly, operations=operations), tuple(evidence))


def without_contacts(observation: Observation, rules: Rules, verb: str) -> Observation:
    """What was seen, with no contact of any operation.

    Raises:
        InputError: Something else was given to the verb.
    """
    for given, wanted in ((observation, Observation), (rules, Rules)):
        if not isinstance(given, wanted):
            raise InputError(
                f"{kind(given)} was given to {verb}; an Observation is allowed (read_observation reads one from a "
                "file), and as rules RULES_BY_NOISE, FIXED_RULES or Rules(...) of apo_bench.recognition.thresholds."
            )
    bare = tuple(replace(operation, contacts=()) for operation in observation.assembly.operations)
    return replace(observation, assembly=replace(observation.assembly, operations=bare, gaps={}))


class _Candidate(NamedTuple):
    """A pair of faces that may touch, and how well that fits what is believed."""

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
    """Twice the logarithm of how much likelier a closed pair is than one anywhere within the bounds, see `_gain`."""


class _Found(NamedTuple):
    """Contacts that go together."""

    taken: tuple[_Candidate, ...]
    belief: Belief
    score: float
    """Sum of the squared lengths, less what each equation that was not implied gains by closing: see `_gain`."""
    left: tuple[Contact, ...]
    """Candidates at the beginning that were not taken."""


@dataclass(frozen=True, eq=False)
class _Around:
    """One operation and what stands around it."""

    seen: Observation
    rules: Rules
    k: int
    others: tuple[str, ...]

    def candidates(self, belief: Belief, taken: Collection[Contact] = ()) -> tuple[_Candidate, ...]:
        """The pairs within the thresholds that were not taken yet, the likeliest first."""
        now = belief.standing(self.k)
        found = [c for a, b, pair in self._pairs(now, taken) for c in self._judged(a, b, pair, now, belief)]
        return tuple(sorted(found, key=lambda c: (c.distance * (3 / len(c.pair.residual)), c.contact)))

    def fixed(self, belief: Belief) -> _Found:
        """Every pair within fixed thresholds; nothing is concluded from one to the other."""
        return _Found(self.candidates(belief), belief, 0.0, ())

    def likeliest(self, belief: Belief) -> _Found:
        """The contacts that go together: of all beginnings, the set with the least score."""
        best = self._followed(belief, None)
        for first in best.left[:_BEGINNINGS]:
            other = self._followed(belief, first)
            if other.score < best.score:
                best = other
        return best

    def evidence(self, found: _Found, as_seen: PartBeliefs) -> Iterator[Evidence]:
        """What speaks for the contacts, in the order of parts and faces."""
        for c in sorted(found.taken, key=lambda c: self._place(c.contact)):
            yield Evidence(
                contact=c.contact,
                made=self.k,
                gap_m=c.pair.gap_m,
                angle_rad=c.pair.angle_rad,
                share=c.pair.share,
                most=c.most,
                seen_gap_m=self._gap(c.contact, as_seen),
            )

    def _followed(self, belief: Belief, first: Contact | None) -> _Found:
        """Take the likeliest candidate (or a given one), put the goals where it closes, and look again."""
        at_first = at_hand = self.candidates(belief)
        taken = list[_Candidate]()
        total = 0.0
        while at_hand:
            chosen = next((c for c in at_hand if c.contact == first), at_hand[0])
            if chosen.distance > self.rules.most_of(len(chosen.pair.residual)):
                break
            belief = belief.given(chosen.pair.residual, chosen.slope, chosen.noise)
            taken.append(chosen)
            total += chosen.distance - chosen.gain
            at_hand = self.candidates(belief, [c.contact for c in taken])
        have = {c.contact for c in taken}
        return _Found(tuple(taken), belief, total, tuple(c.contact for c in at_first if c.contact not in have))

    def _pairs(self, now: PartBeliefs, taken: Collection[Contact]) -> Iterator[tuple[str, str, Facing]]:
        """Faces of moved parts and of those that stand there, within the bounds, with the names of the parts."""
        solids = self.seen.assembly.solids
        rules = self.rules
        bounds = {"gap_m": rules.gap_m, "angle_rad": rules.angle_rad, "share": rules.share}
        for a in self.seen.assembly.operations[self.k].moves:
            for b in self.others:
                known = {(m.face, e.face) for m, e in taken if (m.part, e.part) == (a, b)}
                for pair in facing(solids[a], now.poses[a], solids[b], now.poses[b], **bounds, known=known):
                    yield a, b, pair

    def _judged(self, a: str, b: str, pair: Facing, now: PartBeliefs, belief: Belief) -> Iterator[_Candidate]:
        """The pair as a candidate, if it is one."""
        slope = pair.slope @ (now.reach[a] - now.reach[b])
        if slope.reshape(len(slope), -1, 6)[:, ~self.seen.seen].any():
            return
        contact = Contact(PartFace(a, pair.a), PartFace(b, pair.b))
        play_m = self.seen.assembly.play(contact, self.seen.play_m)
        C = slope @ belief.covariance @ slope.T
        noise = reality(pair, play_m)
        most = pair_thresholds(self.rules, C, slack(pair, play_m), pair.lengths)
        if abs(pair.gap_m) <= most.gap_m and pair.angle_rad <= most.angle_rad:
            e = pair.residual
            distance = float(e @ np.linalg.solve(C + noise, e))
            yield _Candidate(contact, pair, slope, noise, most, distance, _gain(C, noise, self.rules, pair.lengths))

    def _place(self, contact: Contact) -> tuple[int, ...]:
        """Where a contact stands in the order of parts and faces."""
        solids = self.seen.assembly.solids
        order = (self.seen.assembly.operations[self.k].moves, self.others)
        return tuple(
            i
            for parts, of in zip(order, contact, strict=True)
            for i in (parts.index(of.part), [*solids[of.part].faces, *solids[of.part].rounds].index(of.face))
        )

    def _gap(self, contact: Contact, now: PartBeliefs) -> float:
        """The gap of a contact at given poses: at the middle of the environment face where nothing overlaps."""
        a, b = contact
        face_a = self.seen.assembly.face_of(a)
        face_b = self.seen.assembly.face_of(b)
        return face_gap(face_a, now.poses[a.part], face_b, now.poses[b.part])


def _gain(C: Array, noise: Array, rules: Rules, lengths: int) -> float:
    """What a pair that closes gains, before its squared length is taken off.

    Along every axis in which the goals leave it uncertain, (range)^2 / (2 pi variance), the range being that within
    the bounds. What earlier contacts imply anyway gains nothing: it is no coincidence.
    """
    span = np.array([2 * rules.gap_m] * lengths + [2 * rules.angle_rad] * (len(C) - lengths))
    variance, V = np.linalg.eigh(C / np.outer(span, span))
    real = np.einsum("ij,ik,kj->j", V, noise / np.outer(span, span), V)
    new = variance > real
    return float(np.maximum(-np.log(2 * np.pi * (variance + real)[new]), 0.0).sum())
