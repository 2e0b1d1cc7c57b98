"""Search for the most likely hypothesis: which views are outliers, or which relation is wrong.

If the test of `contact` passes, nothing is doubted. If it fails, the search looks for the smallest sets of operations
without which the rest agrees. A set is solved only if the contacts that depend on none of it agree with each other,
which is quick to check. Among sets whose test passes the most likely is taken. Then single states are changed while
that improves it, and relations are dropped in place of operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import combinations, groupby, product
from typing import final

import numpy as np

from apo_bench.assembly import Observation, find_equation_pattern
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
    exchanges,
    false_together,
    likely_beliefs,
    swaps,
)
from apo_bench.correction.robust.views import beliefs
from apo_bench.geometry import Array

MOST_EXACT = 12
"""Number of operations up to which every set is checked; beyond, sets grow by one operation at a time."""
_MOST_EXCHANGED = 8
"""Number of operations up to which any two are tried as swapped, whatever else is in doubt."""
_LENIENT = 1e-4
"""A set is not solved if the contacts that remain agree with a p-value below this."""
_MOST_SOLVED = 24
"""Most hypotheses of one set size that are solved, those that agree best."""
_BY = 15.0
"""Difference in -2 log by which a less likely outlier counts like one more operation in a set."""
_MOST_STARTS = 32
"""Most combinations of equally likely states that are compared as a start."""
_EQUALLY = 2.0
"""Difference in -2 log up to which two states of an operation are equally likely."""
_MOST_OTHER = 3
"""Most alternative states of one operation in a set."""
_MOST_ALTOGETHER = 100
"""Most hypotheses before the search stops growing sets; the refinement may look at as many more."""
_HOPELESS = 150.0
"""Difference in estimated -2 log from the best beyond which a hypothesis is not solved. Of 742 hypotheses, of outliers
in ten scenes, that were within 60 when solved, the largest estimate was 118."""
_MOST_KEPT = 16
"""Most hypotheses that are reported."""
_LEAST_KEPT = 1e-3
"""Least weight of a reported hypothesis, relative to the best."""


@final
class Search:
    """The hypotheses of one case, each solved at most once."""

    def __init__(self, case: Case, level: float, temperature: float = 1.0) -> None:
        """Begin a search without solved hypotheses.

        Args:
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
        """The hypothesis with the most likely state of each operation by itself."""

    def likeliest(self, known: SolvedHypothesis | None = None) -> SolvedHypothesis | None:
        """The most likely hypothesis that was found; None if none has a solution.

        Args:
            known: The most likely hypothesis before the last reobservation.
        """
        start = self._start()
        self.first = self._try(start)
        if self.first.p_value >= self._level:
            self._improve(self.first, self._swaps)
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
        """Add hypotheses with larger noise: of the start, and of the most likely one."""
        for one in (self.first, min(self._known(), key=_badness, default=None)):
            if one is not None and (scale_noise := one.scale_noise()).scale > one.scale:
                self._solved[scale_noise.key] = scale_noise

    def share(self, best: SolvedHypothesis, k: int) -> float:
        """Probability, over all solved hypotheses, that operation k is in another state than in `best`."""
        return self.weight(best, lambda other: other.states[k] != best.states[k])

    def rival(self, best: SolvedHypothesis) -> SolvedHypothesis | None:
        """The most likely hypothesis of the other kind: with a dropped relation if `best` has none, or without one."""
        others = [other for other in self._known() if bool(other.dropped) != bool(best.dropped)]
        return min(others, key=_badness, default=None)

    def weight(self, best: SolvedHypothesis, which: Callable[[SolvedHypothesis], bool]) -> float:
        """Total probability of the hypotheses that satisfy `which`."""
        known = self._known()
        weights = self._weights(known, best)
        return float(weights @ [which(other) for other in known] / weights.sum())

    def weighted(self) -> list[tuple[float, SolvedHypothesis]]:
        """The most likely hypotheses with their weights, which add up to 1, the best first."""
        known = sorted(self._known(), key=_badness)[:_MOST_KEPT]
        if not known:
            return []
        weights = self._weights(known, known[0])
        kept = [(weight, solved) for weight, solved in zip(weights, known, strict=True) if weight >= _LEAST_KEPT]
        whole = sum(weight for weight, _ in kept)
        return [(float(weight / whole), solved) for weight, solved in kept]

    def _weights(self, some: list[SolvedHypothesis], best: SolvedHypothesis) -> Array:
        """Likelihood of each hypothesis relative to the best, at the temperature."""
        return np.exp([-0.5 / self._temperature * (one.badness - best.badness) for one in some])

    def _known(self) -> list[SolvedHypothesis]:
        """The solved hypotheses that have a solution."""
        return [solved for solved in self._solved.values() if np.isfinite(solved.badness)]

    def _try(
        self, states: States, dropped: tuple[str, ...] = (), assumed: Observation | None = None
    ) -> SolvedHypothesis:
        """The solved hypothesis with these states and dropped relations, from the cache or new."""
        key = states, dropped, False
        if key not in self._solved:
            self._solved[key] = hypothesis(self._case, states, dropped, assumed)
        return self._solved[key]

    def _looked_at(self) -> int:
        """Number of hypotheses that were solved or rejected by their estimate."""
        return len(self._solved.keys() | self._expected.keys())

    def _solve(self, some: Iterable[tuple[States, tuple[str, ...]]], least: float = np.inf) -> list[SolvedHypothesis]:
        """Solve hypotheses in the order of their estimates, except those that are hopeless; return the solved ones.

        Args:
            some: States and dropped relations of each.
            least: The -2 log of the best so far, with which estimates are compared.
        """
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
        """The most likely state of each operation by itself; ties are broken by the agreement of the contacts."""
        likeliest = [[state for s, state in own if s <= own[0][0] + _EQUALLY] for own in self._beliefs]
        several = [one for _, one in zip(range(_MOST_STARTS), product(*likeliest), strict=False)]
        if len(several) == 1:
            return several[0]
        return min(several, key=lambda states: ContactAgreement(self._case, states).disagreement())

    def _smallest(self, start: States) -> SolvedHypothesis | None:
        """The most likely hypothesis of the smallest size, sets of operations or single relations, whose test passes.

        If none passes, the most likely of all that were solved.
        """
        tried = self._solve((start, (relation,)) for relation in self._relations(start))
        if self.operations <= _MOST_EXCHANGED:
            tried += self._solve((states, ()) for states in exchanges(self._case, start))
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
        """Yield hypotheses that change the states of a set of operations, size by size, those that agree best first."""
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
        """Yield sets of operations in order of their size; never all operations, unless there is only one.

        Args:
            size: Size for which each operation counts.
            rest: Agreement of the contacts, by which sets of many operations are grown.
        """
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
        """Size for which operation k counts in a set: the surprise of its next state in units of `_BY`, at least 1."""
        known = {state: surprise for surprise, state in self._beliefs[k]}
        least = min((surprise for state, surprise in known.items() if state != now), default=known[now])
        return max(1, round((least - known[now]) / _BY))

    def _trusted_state(self, k: int) -> State:
        """The most likely state of operation k that trusts a view."""
        return next(state for _, state in self._beliefs[k] if INLIER in state)

    def _refine(self, best: SolvedHypothesis) -> None:
        """Improve a hypothesis by changes of single states, and by relations in place of operations."""
        self._improve(best, self._changes)

    def _improve(
        self, best: SolvedHypothesis, changes: Callable[[SolvedHypothesis], Iterable[tuple[States, tuple[str, ...]]]]
    ) -> None:
        """Improve a hypothesis by one change after another, until none makes it more likely or the budget is spent."""
        most = self._looked_at() + _MOST_ALTOGETHER
        while self._looked_at() < most:
            better = min(self._solve(changes(best), best.badness), key=_badness, default=best)
            if not better.badness < best.badness:
                return
            best = better

    def _changes(self, best: SolvedHypothesis) -> Iterator[tuple[States, tuple[str, ...]]]:
        """Yield the states and dropped relations of the neighbours of a hypothesis."""
        yield from ((states, best.dropped) for states in self._near(best))
        yield from ((states, (relation,)) for states, relation in self._instead(best))

    def _swaps(self, best: SolvedHypothesis) -> Iterator[tuple[States, tuple[str, ...]]]:
        """Yield states that explain views which contradict another view of their operation as swapped."""
        if any(len(state) > 1 and any(map(is_false, state)) for state in best.states):
            yield from ((states, best.dropped) for states in swaps(self._case, best.states))

    def _near(self, best: SolvedHypothesis) -> Iterator[States]:
        """Yield states that differ in one view that is no inlier, in two swapped views, or in a displaced row."""
        states = best.states
        for k, (views, state) in enumerate(zip(self._case.views, states, strict=True)):
            for i, now in enumerate(state):
                # Of several views of an operation that is in doubt the one that is assumed may be the false one.
                # Of two exchanged views none is changed alone.
                if now == DISPLACED or now < 0 or set(state) == {INLIER}:
                    continue
                blank = change_states(states, (k,), ((*state[:i], GROSS, *state[i + 1 :]),))
                yield blank
                for belief in likely_beliefs(self._case, self._try(blank, best.dropped), k, views[i]):
                    yield change_states(states, (k,), ((*state[:i], belief, *state[i + 1 :]),))
        yield from swaps(self._case, states)
        yield from displace_together(states)

    def _instead(self, best: SolvedHypothesis) -> Iterator[tuple[States, str]]:
        """Yield states in which an operation in doubt is trusted, with a relation of it to drop instead."""
        doubted = [k for k, state in enumerate(best.states) if any(map(is_false, state))]
        for k in () if best.dropped else doubted:
            states = change_states(best.states, (k,), (self._trusted_state(k),))
            yield from ((states, relation) for relation in self._relations(states, k))

    def _relations(self, states: States, of: int | None = None) -> Iterator[str]:
        """Yield relations, and single contacts of them, without which the remaining contacts agree.

        Args:
            of: Only relations that depend on this operation; None: all.
        """
        assembly = self._case.observation.assembly
        rest = ContactAgreement(self._case, states)
        letters = find_equation_pattern(assembly).letters - len(assembly.solids)
        for i, arc in enumerate(assembly.arcs()):
            # What agrees without one contact agrees without the whole relation, but for the share of false alarms.
            if (of is None or (letters[list(arc)] == of).any()) and rest.agreement((), arc) >= _LENIENT:
                relation = f"R{i + 1}"
                yield relation
                single = contacts_of(assembly, relation)
                if len(single) > 1:
                    yield from (name for name, group in single.items() if rest.agreement((), group) >= _LENIENT)


def _badness(solved: SolvedHypothesis) -> float:
    """The sort key of hypotheses."""
    return solved.badness
