"""Neighbours of a hypothesis in the search: one view with another belief, two views swapped, or a row displaced."""

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
from apo_bench.correction.robust.views import Sightings, merge_views, views_by_state
from apo_bench.geometry import Array, pose

_MOST_READINGS = 3
"""Most beliefs of one view that are solved."""
_UNLIKELY = 30.0
"""Difference in -2 log from the most likely belief beyond which a belief is not solved."""
_FINE = np.diag(np.repeat([1e-4, 1e-3], 3) ** 2)
"""Covariance added to that of inferred poses, (6, 6), [m, rad], since contacts fix some directions exactly."""
_WIDER = 2
"""Number of operations by which a displaced row is extended at either end."""


def change_states(states: States, which: Sequence[int], to: Sequence[State]) -> States:
    """The states with those of operations `which` replaced by `to`."""
    new = dict(zip(which, to, strict=True))
    return tuple(new.get(k, state) for k, state in enumerate(states))


def likely_beliefs(case: Case, without: SolvedHypothesis, k: int, view: Sighting) -> list[int]:
    """The most likely beliefs of a view, the best first, given the poses that are inferred without it.

    Near these poses everything is Gaussian: a belief is scored by the distance of its pose from the inferred one, in
    standard deviations of both.

    Args:
        without: The solved hypothesis in which this view is rejected.
        k: The operation of the view.
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
    """The covariance of an inferred pose, (6, 6), if only contacts constrain it: prior `ROOM` in place of `UNKNOWN`."""
    W = np.linalg.inv(C) - np.linalg.inv(UNKNOWN) + np.linalg.inv(ROOM)
    w, V = np.linalg.eigh((W + W.T) / 2)
    return np.asarray((V / np.maximum(w, 1.0)) @ V.T)


def swaps(case: Case, states: States) -> Iterator[States]:
    """Yield states in which the views of two operations are swapped.

    At least one of the two is in doubt; both are, if their parts differ.
    """
    doubted = {k for k, state in enumerate(states) if any(map(is_false, state))}
    solids = [case.observation.assembly.solids[one.main] for one in case.observation.assembly.operations]
    for k in sorted(doubted):
        for i in case.views[k][0].others if states[k] else ():
            if states[i] and not (i in doubted and i < k) and (i in doubted or solids[i] is solids[k]):
                yield from _swap(case.views, states, k, i)


def _swap(views: Sightings, states: States, k: int, i: int) -> Iterator[States]:
    """Yield states in which operations k and i are swapped in one or several of the observations of both."""
    common = sorted({view.look for view in views[k]} & {view.look for view in views[i]})
    for size in range(1, len(common) + 1):
        for looks in combinations(common, size):
            yield change_states(
                states,
                (k, i),
                [
                    tuple(
                        swapped_with(other) if view.look in looks else belief
                        for view, belief in zip(views[own], states[own], strict=True)
                    )
                    for own, other in ((k, i), (i, k))
                ],
            )


def continue_states(views: Sightings, states: States, model: OutlierModel) -> States:
    """Extend the states of earlier views by the most likely belief of each new view: inlier, gross, or the first one
    again.
    """
    grown = list[State]()
    for k, (own, state) in enumerate(zip(views, states, strict=True)):
        now = state
        for j in range(len(state), len(own)):
            every = [(*now, belief) for belief in dict.fromkeys((INLIER, GROSS, *now[:1])) if belief >= 0]
            now = min(
                every, key=lambda one: merge_views(own[: j + 1], one, model, views_by_state(views, k, one)).surprise
            )
        grown.append(now)
    return tuple(grown)


def displace_together(states: States) -> Iterator[States]:
    """Yield states in which a row of consecutive operations is displaced: those in doubt, and some neighbours."""
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
    # Also shorten an existing row by one operation at either end.
    displaced = [k for k in doubted if states[k] == (DISPLACED,)]
    if len(displaced) > 2:
        yield from (change_states(states, (k,), ((INLIER,),)) for k in (displaced[0], displaced[-1]))


def exchanges(case: Case, start: States) -> Iterator[States]:
    """Yield states in which the views of any two operations are swapped."""
    for k, state in enumerate(start):
        for i in case.views[k][0].others if state else ():
            if i > k and start[i]:
                yield from _swap(case.views, start, k, i)


def false_together(case: Case, start: States) -> Iterator[States]:
    """Yield states for the case that no set of operations agrees without the rest.

    All observed operations gross; any two swapped; any row of consecutive ones displaced.
    """
    seen = [k for k, state in enumerate(start) if state]
    yield change_states(start, seen, [(GROSS,) * len(start[k]) for k in seen])
    yield from exchanges(case, start)
    for row in combinations(range(len(start)), 2):
        between = range(row[0], row[1] + 1)
        if all(len(start[k]) == 1 for k in between):
            yield change_states(start, between, [(DISPLACED,)] * len(between))
