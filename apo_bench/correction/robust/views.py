"""What was seen of each operation, once or several times, and what comes of it if some of that is not believed.

A view is an inlier, seen with the stated noise; broad, seen with some times that; gross, so that it says nothing; or
flipped, seen with the stated noise but turned, as a part that nearly looks the same after that turn may be.
Views of one operation that are believed are merged into one Gaussian. That they agree is evidence that they are right,
since gross views lie anywhere.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation, OutlierModel
from apo_bench.geometry import Array, approximate_symmetries, frozen, pose

INLIER = 0
BROAD = 1
GROSS = 2
FLIPPED = 3
"""By the first of the turns of its part; the next number by the next one."""
State = tuple[int, ...]
"""One of these for each view of an operation; empty if it was never seen."""
ROOM = frozen(np.diag(np.repeat([0.5, (8.0 * np.pi**2) ** (1 / 3)], 3) ** 2 / (2.0 * np.pi)))
"""(6, 6): a Gaussian as dense in its middle as poses anywhere in half a metre, turned anyhow, are; [m, rad]."""
_MOST_TOGETHER = 4
"""Of more views than this only those that agree are believed together."""
_AGREE = 50.0
"""Views whose difference is longer than this, squared and in standard deviations, are not inliers both."""
_IMPOSSIBLE = 100.0
"""States that are less likely than the likeliest by so much in -2 log are not looked at."""
_ITERATIONS = 5


class Sighting(NamedTuple):
    """An operation as it was seen once."""

    goal: Array
    """(4, 4)."""
    covariance: Array
    """(6, 6), [m, rad]."""
    flips: Array
    """(m, 4, 4), body displacements after which its part nearly looks the same."""


class Merged(NamedTuple):
    """What the views of an operation say together if they are in some state."""

    goal: Array | None
    """(4, 4); None if none of them is believed."""
    covariance: Array
    surprise: float
    """-2 log of how likely such states and views are, beside one inlier, whatever contacts say."""


Sightings = tuple[tuple[Sighting, ...], ...]
"""Those of each operation."""


def views_of(observation: Observation) -> Sightings:
    """What was seen, once at most."""
    return looked_again(((),) * len(observation.goals), observation)


def looked_again(views: Sightings, observation: Observation) -> Sightings:
    """With what was seen this time."""
    assembly = observation.assembly
    flips = [approximate_symmetries(assembly.solids[operation.main]).turns for operation in assembly.operations]
    new = zip(views, observation.seen, observation.goals, observation.covariance, flips, strict=True)
    return tuple((*old, Sighting(goal, C, turns)) if seen else old for old, seen, goal, C, turns in new)


def merged(views: Sequence[Sighting], state: State, model: OutlierModel) -> Merged:
    """What the views of one operation say together."""
    pairs = list(zip(views, state, strict=True))
    believed = [_read(view, belief, model) for view, belief in pairs if belief != GROSS]
    surprise = sum(_surprise(view, belief, model) for view, belief in pairs)
    anywhere = _log_volume(ROOM)
    if not believed:
        return Merged(None, ROOM, surprise + anywhere * max(0, len(views) - 1))
    surprise += anywhere * (len(views) - len(believed))
    if len(believed) == 1:
        return Merged(believed[0].goal, believed[0].covariance, surprise)
    goal, covariance, length = _mean(believed)
    apart = sum(_log_volume(view.covariance) for view in believed) - _log_volume(covariance)
    return Merged(goal, covariance, surprise + length + apart)


def _read(view: Sighting, belief: int, model: OutlierModel) -> Sighting:
    """What a view says of the goal if it is believed so."""
    if belief == INLIER:
        return view
    if belief == BROAD:
        return view._replace(covariance=view.covariance * model.times**2)
    # The true goal is T F where T was seen, so a body twist xi at T is Ad(F^-1) xi there.
    F = view.flips[belief - FLIPPED]
    A = pose.adjoint(pose.inverse(F))
    C = A @ view.covariance @ A.T
    return view._replace(goal=view.goal @ F, covariance=(C + C.T) / 2)


def _surprise(view: Sighting, belief: int, model: OutlierModel) -> float:
    """-2 log of how likely a state of a view is, beside an inlier."""
    if belief < GROSS:
        return model.surprises[belief]
    return model.gross_surprises(len(view.flips))[belief != GROSS]


def beliefs(views: Sequence[Sighting], model: OutlierModel) -> list[tuple[float, State]]:
    """States of the views of one operation without broad ones, each with its surprise, the likeliest first;
    those that are out of the question are left out.

    Of equally likely ones that which believes the latest view: an earlier one was looked at again for a reason.
    """
    m = len(views)
    groups: set[tuple[int, ...]] = {()}
    if m <= _MOST_TOGETHER:
        groups.update(g for size in range(1, m + 1) for g in combinations(range(m), size))
    else:
        groups.update(tuple(j for j in range(m) if i == j or _agree(views[i], views[j])) for i in range(m))
    rated = []
    for group in groups:
        state = tuple(INLIER if i in group else GROSS for i in range(m))
        rated.append((round(merged(views, state, model).surprise, 6), tuple(-i for i in group[::-1]), state))
    likely = min(rated)[0] + _IMPOSSIBLE
    return [(surprise, state) for surprise, _, state in sorted(rated) if surprise < likely or set(state) == {GROSS}]


def _agree(a: Sighting, b: Sighting) -> bool:
    xi = pose.log(pose.inverse(a.goal) @ b.goal)
    return float(xi @ np.linalg.solve(a.covariance + b.covariance, xi)) < _AGREE


def _mean(views: Sequence[Sighting]) -> tuple[Array, Array, float]:
    """The most likely pose, its covariance, and the squared length of all deviations from it."""
    goals = np.array([view.goal for view in views])
    W = np.linalg.inv([view.covariance for view in views])
    C = np.linalg.inv(W.sum(axis=0))
    T = goals[-1]
    for _ in range(_ITERATIONS):
        T = T @ pose.exp(C @ np.einsum("kij,kj->i", W, pose.log(pose.inverse(T) @ goals)))
    xi = pose.log(pose.inverse(T) @ goals)
    return T, (C + C.T) / 2, float(np.einsum("ki,kij,kj->", xi, W, xi))


def _log_volume(covariance: Array) -> float:
    """-2 log of the density of a Gaussian in its middle."""
    return float(np.linalg.slogdet(2.0 * np.pi * covariance)[1])
