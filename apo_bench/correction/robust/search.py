"""The likeliest hypothesis: which views are outliers, or which relation is wrong.

While the test of `contact` holds, nothing is doubted. If it fails, the smallest sets of operations are looked for
without which the rest agrees: a set is solved only if the contacts that none of it has a part in agree with each other
at what was observed, which is quick to check for every set. Of the sets whose test holds the likeliest is taken. Then
each of its states is changed while that is likelier, and each relation that it has a part in may be wrong instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import combinations, groupby, product
from typing import final

import numpy as np

from apo_bench.assembly import Observation, find_contact_pattern
from apo_bench.correction.contact.suspects import contacts_of
from apo_bench.correction.robust.agreement import ContactAgreement, expected_badness
from apo_bench.correction.robust.beliefs import DISPLACED, GROSS, INLIER, State, States, is_false
from apo_bench.correction.robust.hypotheses import (
    Case,
    SolvedHypothesis,
    assumed_observation,
    hypothesis,
)
from apo_bench.correction.robust.nearby import (
    change_states,
    continue_states,
    displace_together,
    false_together,
    likely_beliefs,
    swaps,
)
from apo_bench.correction.robust.views import beliefs
from apo_bench.geometry import Array

MOST_EXACT = 12
"""Operations up to which every set is looked at; of more, sets grow by one operation at a time."""
_LENIENT = 1e-4
"""A set is not solved if what is left of the contacts agrees worse than by this p-value."""
_MOST_SOLVED = 24
"""Hypotheses of one size that are solved, those whose rest agrees best."""
_BY = 15.0
"""An operation that is less likely to be wrong, by so much in -2 log, counts like one more of a set."""
_MOST_STARTS = 32
_EQUALLY = 2.0
"""States of an operation that differ by less, in -2 log, are as likely as each other by themselves."""
_MOST_OTHER = 3
"""States of one operation that are tried in a set."""
_MOST_ALTOGETHER = 100
"""Hypotheses beyond which no larger sets are tried, and so many more beyond which nothing is refined."""
_HOPELESS = 150.0
"""What is so much less likely than the likeliest, in -2 log, by contacts that are linearised once, is not solved. Of
742 hypotheses, of outliers in ten scenes, that were within 60 when they were solved the farthest was at 118 by that."""
_MOST_KEPT = 16
_LEAST_KEPT = 1e-3
"""Hypotheses that are reported at most, and how likely one is at least relative to the likeliest."""


@final
class Search:
    """The hypotheses of one case, each solved once."""

    def __init__(self, case: Case, level: float, temperature: float = 1.0) -> None:
        """Args:
        level: As of `RobustCorrector`, and so is `temperature`.
        """
        self._temperature = temperature
        self._case = case
        self._level = level
        self._beliefs = [beliefs(views, case.model) for views in case.views]
        self._solved: dict[tuple[States, tuple[str, ...], bool], SolvedHypothesis] = {}
        self._expected: dict[tuple[States, tuple[str, ...], bool], float] = {}
        self.operations = len(case.views)
        self.first: SolvedHypothesis | None = None
        """What is likeliest of each operation by itself."""

    def likeliest(self, known: SolvedHypothesis | None = None) -> SolvedHypothesis | None:
        """None if nothing that was tried has a solution; `known` is what was likeliest before the last look."""
        start = self._start()
        self.first = self._try(start)
        if self.first.p_value >= self._level:
            self._rescale()
            return min(self._known(), key=_badness)
        best = None
        if known is not None:
            best = self._try(continue_states(self._case.views, known.states, self._case.model), known.dropped)
            self._refine(best)
            best = min(self._known(), key=_badness, default=None)
        if best is None or best.p_value < self._level or best.dropped:
            best = self._smallest(start)
        if best is not None:
            self._refine(best)
            # Where a relation is to blame, the likeliest observation to blame in its place may have been turned.
            rival = self.rival(best) if best.dropped else None
            if rival is not None:
                self._refine(rival)
        self._rescale()
        return min(self._known(), key=_badness, default=None)

    def _rescale(self) -> None:
        """What if noise is larger than stated: all that was observed assumed, or what is likeliest."""
        for one in (self.first, min(self._known(), key=_badness, default=None)):
            if one is not None and (scale_noise := one.scale_noise()).scale > one.scale:
                self._solved[scale_noise.key] = scale_noise

    def share(self, best: SolvedHypothesis, k: int) -> float:
        """How likely it is, of all hypotheses that were solved, that operation k is not in the state that was found."""
        return self.weight(best, lambda other: other.states[k] != best.states[k])

    def rival(self, best: SolvedHypothesis) -> SolvedHypothesis | None:
        """The likeliest explanation of the other kind: with a wrong relation, or without one."""
        others = [other for other in self._known() if bool(other.dropped) != bool(best.dropped)]
        return min(others, key=_badness, default=None)

    def weight(self, best: SolvedHypothesis, which: Callable[[SolvedHypothesis], bool]) -> float:
        """How likely some of the hypotheses are together."""
        known = self._known()
        weights = self._weights(known, best)
        return float(weights @ [which(other) for other in known] / weights.sum())

    def weighted(self) -> list[tuple[float, SolvedHypothesis]]:
        """What was solved with its weight, the likeliest first; the unlikely ones left out."""
        known = sorted(self._known(), key=_badness)[:_MOST_KEPT]
        if not known:
            return []
        weights = self._weights(known, known[0])
        kept = [(weight, solved) for weight, solved in zip(weights, known, strict=True) if weight >= _LEAST_KEPT]
        whole = sum(weight for weight, _ in kept)
        return [(float(weight / whole), solved) for weight, solved in kept]

    def _weights(self, some: list[SolvedHypothesis], best: SolvedHypothesis) -> Array:
        """How likely some are relative to the best: their likelihood by the temperature."""
        return np.exp([-0.5 / self._temperature * (one.badness - best.badness) for one in some])

    def _known(self) -> list[SolvedHypothesis]:
        return [solved for solved in self._solved.values() if np.isfinite(solved.badness)]

    def _try(
        self, states: States, dropped: tuple[str, ...] = (), assumed: Observation | None = None
    ) -> SolvedHypothesis:
        key = states, dropped, False
        if key not in self._solved:
            self._solved[key] = hypothesis(self._case, states, dropped, assumed)
        return self._solved[key]

    def _looked_at(self) -> int:
        """How many hypotheses were solved, or found to be hopeless."""
        return len(self._solved.keys() | self._expected.keys())

    def _solve(self, some: Iterable[tuple[States, tuple[str, ...]]], least: float = np.inf) -> list[SolvedHypothesis]:
        """Those of some hypotheses, solved, that are not hopeless compared with this -2 log."""
        some = list(some)
        assumed = dict[States, Observation]()
        for states, dropped in some:
            key = states, dropped, False
            if key not in self._solved and key not in self._expected:
                if states not in assumed:
                    assumed[states] = assumed_observation(self._case, states)
                self._expected[key] = expected_badness(self._case, states, dropped, assumed[states])
        for states, dropped in sorted(some, key=lambda one: self._expected.get((*one, False), -np.inf)):
            key = states, dropped, False
            if key in self._solved or self._expected[key] <= least + _HOPELESS:
                least = min(least, self._try(states, dropped, assumed.get(states)).badness)
        return [
            self._solved[states, dropped, False] for states, dropped in some if (states, dropped, False) in self._solved
        ]

    def _start(self) -> States:
        """The likeliest state of each operation by itself; of those that are equally likely what contacts like best."""
        likeliest = [[state for s, state in own if s <= own[0][0] + _EQUALLY] for own in self._beliefs]
        several = [one for _, one in zip(range(_MOST_STARTS), product(*likeliest), strict=False)]
        if len(several) == 1:
            return several[0]
        return min(several, key=lambda states: ContactAgreement(self._case, states).disagreement())

    def _smallest(self, start: States) -> SolvedHypothesis | None:
        """The likeliest of the smallest sets, or single relations, whose test holds; else of all that were solved."""
        tried = self._solve((start, (relation,)) for relation in self._relations(start))
        gross = self._case.model.surprises[GROSS]
        for size, sets in enumerate(self._sets(start), start=1):
            if self._looked_at() > _MOST_ALTOGETHER:
                break
            tried += self._solve((states, ()) for states in sets)
            held = [solved for solved in tried if solved.p_value >= self._level]
            # A wrong relation is no answer while as many gross views as could be tried next are likelier.
            dearer = (size + 1) * gross > self._case.model.relation_surprise
            if held and (dearer or not all(solved.dropped for solved in held)):
                return min(held, key=_badness)
        if all(solved.p_value < self._level for solved in tried):
            self._solve((states, ()) for states in false_together(self._case, start))
        return min(self._known(), key=_badness, default=None)

    def _sets(self, start: States) -> Iterator[list[States]]:
        """States in which some operations are in another than at the start, size by size, the best agreeing first."""
        rest = ContactAgreement(self._case, start)
        seen = [k for k, views in enumerate(self._case.views) if views]
        other = {k: [state for _, state in self._beliefs[k] if state != start[k]][:_MOST_OTHER] for k in seen}
        size = {k: self._size(k, start[k]) for k in other}
        for some in self._grown(size, rest):
            rated = sorted(((rest.agreement(s), s) for s in some), key=lambda set_: (-set_[0], set_[1]))
            agreeing = [s for p, s in rated if p >= _LENIENT]
            every = (change_states(start, s, to) for s in agreeing for to in product(*(other[k] for k in s)))
            yield [states for _, states in zip(range(_MOST_SOLVED), every, strict=False)]

    def _grown(self, size: dict[int, int], rest: ContactAgreement) -> Iterator[list[tuple[int, ...]]]:
        """Sets of operations by size; not all of them together, but a single one."""
        if len(size) <= MOST_EXACT:
            every = [s for m in range(1, max(len(size), 2)) for s in combinations(size, m)]
            sizes = {s: sum(size[k] for k in s) for s in every}
            yield from (list(some) for _, some in groupby(sorted(every, key=sizes.__getitem__), sizes.__getitem__))
            return
        grown: list[tuple[int, ...]] = [()]
        for _ in range(1, len(size)):
            chosen = sorted({tuple(sorted({*s, k})) for s in grown for k in size if k not in s})
            yield chosen
            grown = sorted(chosen, key=lambda s: -rest.agreement(s))[:3]

    def _size(self, k: int, now: State) -> int:
        """How many outliers it is worth that operation k is in another state."""
        known = {state: surprise for surprise, state in self._beliefs[k]}
        least = min((surprise for state, surprise in known.items() if state != now), default=known[now])
        return max(1, round((least - known[now]) / _BY))

    def _trusted_state(self, k: int) -> State:
        """The likeliest state of an operation in which a view is assumed."""
        return next(state for _, state in self._beliefs[k] if INLIER in state)

    def _refine(self, best: SolvedHypothesis) -> None:
        """One state after the other changed for the better, until none is; or relations in place of observations."""
        most = self._looked_at() + _MOST_ALTOGETHER
        while self._looked_at() < most:
            near = [(states, best.dropped) for states in self._near(best)]
            near += [(states, (relation,)) for states, relation in self._instead(best)]
            better = min(self._solve(near, best.badness), key=_badness, default=best)
            if not better.badness < best.badness:
                return
            best = better

    def _near(self, best: SolvedHypothesis) -> Iterator[States]:
        """With one view, that is no inlier, in another state; with two exchanged; with some displaced together."""
        states = best.states
        for k, (views, state) in enumerate(zip(self._case.views, states, strict=True)):
            for i, now in enumerate(state):
                # Of several views of an operation that is in doubt the one that is assumed may be the false one.
                if now == DISPLACED or set(state) == {INLIER}:
                    continue
                blank = change_states(states, (k,), ((*state[:i], GROSS, *state[i + 1 :]),))
                yield blank
                for belief in likely_beliefs(self._case, self._try(blank, best.dropped), k, views[i]):
                    yield change_states(states, (k,), ((*state[:i], belief, *state[i + 1 :]),))
        yield from swaps(self._case, states)
        yield from displace_together(states)

    def _instead(self, best: SolvedHypothesis) -> Iterator[tuple[States, str]]:
        """A relation in place of an operation that is in doubt and that it depends on."""
        doubted = [k for k, state in enumerate(best.states) if any(map(is_false, state))]
        for k in () if best.dropped else doubted:
            states = change_states(best.states, (k,), (self._trusted_state(k),))
            yield from ((states, relation) for relation in self._relations(states, k))

    def _relations(self, states: States, of: int | None = None) -> Iterator[str]:
        """Relations, and single contacts of them, without which the rest agrees; or those an operation is part of."""
        assembly = self._case.observation.assembly
        rest = ContactAgreement(self._case, states)
        letters = find_contact_pattern(assembly).letters - len(assembly.solids)
        for i, arc in enumerate(assembly.arcs()):
            # What agrees without one contact agrees without the whole relation, but for the share of false alarms.
            if (of is None or (letters[list(arc)] == of).any()) and rest.agreement((), arc) >= _LENIENT:
                relation = f"R{i + 1}"
                yield relation
                single = contacts_of(assembly, relation)
                if len(single) > 1:
                    yield from (name for name, group in single.items() if rest.agreement((), group) >= _LENIENT)


def _badness(solved: SolvedHypothesis) -> float:
    return solved.badness
