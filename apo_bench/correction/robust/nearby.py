"""Hypotheses that differ from one by what is assumed of an operation, of two that are exchanged, of some in a row."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from apo_bench.assembly import OutlierModel
from apo_bench.correction.robust.beliefs import (
    BROAD,
    DISPLACED,
    GROSS,
    INLIER,
    ROOM,
    Sighting,
    State,
    States,
    alternatives,
    interpret_view,
    is_false,
    log_volume,
    says_nothing,
    surprise,
    swapped_with,
)
from apo_bench.correction.robust.hypotheses import UNKNOWN, Case, SolvedHypothesis
from apo_bench.correction.robust.views import Sightings, exchanged_view, merge_views
from apo_bench.geometry import Array, pose

_MOST_READINGS = 3
"""Readings of one view that are solved."""
_UNLIKELY = 30.0
"""A reading that is less likely than the likeliest by so much in -2 log is not solved."""
_FINE = np.diag(np.repeat([1e-4, 1e-3], 3) ** 2)
"""(6, 6): poses that contacts fix are known to no less than this, [m, rad]."""
_WIDER = 2
"""Operations by which a row of displaced ones is made longer at either end."""


def change_states(states: States, which: Sequence[int], to: Sequence[State]) -> States:
    """With the states of some operations replaced."""
    new = dict(zip(which, to, strict=True))
    return tuple(new.get(k, state) for k, state in enumerate(states))


def likely_beliefs(case: Case, without: SolvedHypothesis, k: int, view: Sighting) -> list[int]:
    """What may be assumed of a view of operation k, the likeliest first, given the poses that are inferred without it.

    Near these poses everything is Gaussian: a reading is as likely as it is near to the inferred pose, in standard
    deviations of both. Of what contacts leave free the inferred pose knows nothing.
    """
    rest = [belief for belief in alternatives(view) if belief not in (BROAD, GROSS)]
    C = without.correction.covariance
    if C is None or not np.isfinite(without.badness):
        return [*rest[: _MOST_READINGS - 1], BROAD]
    told = without.states[k] and not all(map(says_nothing, without.states[k]))
    known = _widen(C[k] + _FINE) if not told else C[k] + _FINE
    rated = list[tuple[float, int]]()
    for belief in (*rest, BROAD):
        unlikely = surprise((view,), (belief,), case.model)
        if not says_nothing(belief):
            T, own = interpret_view(view, belief, case.model)
            apart = pose.log(pose.inverse(without.correction.poses[k]) @ T)
            total = known + own
            unlikely += float(apart @ np.linalg.solve(total, apart)) + log_volume(total) - log_volume(ROOM)
        rated.append((unlikely, belief))
    rated.sort()
    return [belief for unlikely, belief in rated[:_MOST_READINGS] if unlikely < rated[0][0] + _UNLIKELY]


def _widen(C: Array) -> Array:
    """The covariance of an inferred pose if nothing but contacts tells of it: `UNKNOWN` is anywhere in the room."""
    W = np.linalg.inv(C) - np.linalg.inv(UNKNOWN) + np.linalg.inv(ROOM)
    w, V = np.linalg.eigh((W + W.T) / 2)
    return np.asarray((V / np.maximum(w, 1.0)) @ V.T)


def swaps(case: Case, states: States) -> Iterator[States]:
    """With the views of two operations exchanged, of which one at least is in doubt; both if their parts differ."""
    doubted = {k for k, state in enumerate(states) if any(map(is_false, state))}
    solids = [case.observation.assembly.solids[one.main] for one in case.observation.assembly.operations]
    for k in sorted(doubted):
        for i in case.views[k][0].others if states[k] else ():
            if states[i] and not (i in doubted and i < k) and (i in doubted or solids[i] is solids[k]):
                yield change_states(
                    states, (k, i), ((swapped_with(i), *states[k][1:]), (swapped_with(k), *states[i][1:]))
                )


def continue_states(views: Sightings, states: States, model: OutlierModel) -> States:
    """States of the earlier views, with the likeliest of the later ones: right, anywhere, or false again."""
    grown = list[State]()
    for own, state in zip(views, states, strict=True):
        now = state
        for j in range(len(state), len(own)):
            exchanged = exchanged_view(views, now)
            every = [(*now, belief) for belief in dict.fromkeys((INLIER, GROSS, *now[:1])) if belief >= 0]
            now = min(every, key=lambda one: merge_views(own[: j + 1], one, model, exchanged).surprise)
        grown.append(now)
    return tuple(grown)


def displace_together(states: States) -> Iterator[States]:
    """With operations in a row displaced together: those in doubt, and some of their neighbours."""
    alone = [len(state) == 1 for state in states]
    doubted = [k for k, state in enumerate(states) if alone[k] and is_false(state[0])]
    if not doubted:
        return
    n = len(states)
    for first in range(max(0, doubted[0] - _WIDER), doubted[0] + 1):
        for last in range(max(doubted[-1], first + 1), min(n, doubted[-1] + 1 + _WIDER)):
            row = range(first, last + 1)
            if all(alone[k] for k in row):
                yield tuple((DISPLACED,) if k in row else state for k, state in enumerate(states))
    # One operation less at either end of a row.
    displaced = [k for k in doubted if states[k] == (DISPLACED,)]
    if len(displaced) > 2:
        yield from (change_states(states, (k,), ((INLIER,),)) for k in (displaced[0], displaced[-1]))


def false_together(case: Case, start: States) -> Iterator[States]:
    """All operations seen anywhere, any two exchanged, any row displaced: where no set without the rest agrees."""
    seen = [k for k, state in enumerate(start) if state]
    yield change_states(start, seen, [(GROSS,) * len(start[k]) for k in seen])
    for k in seen:
        for i in case.views[k][0].others:
            if i > k and start[i]:
                yield change_states(start, (k, i), ((swapped_with(i), *start[k][1:]), (swapped_with(k), *start[i][1:])))
    for row in combinations(range(len(start)), 2):
        between = range(row[0], row[1] + 1)
        if all(len(start[k]) == 1 for k in between):
            yield change_states(start, between, [(DISPLACED,)] * len(between))
