"""Views of each operation, one or several, and the Gaussian they make together under an assumed state.

Trusted views of one operation are merged into one Gaussian. Their agreement is evidence that they are right, since
false views lie anywhere, unless they repeat the first.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation, OutlierModel, compute_placements
from apo_bench.correction.robust.beliefs import (
    GROSS,
    INLIER,
    ROOM,
    STALE,
    Sighting,
    State,
    interpret_view,
    log_volume,
    says_nothing,
    surprise,
    swapped_with,
)
from apo_bench.geometry import Array, find_approximate_symmetries, pose

_MOST_TOGETHER = 3
"""Number of views up to which all subsets are considered; of more, only views that agree are trusted together."""
_AGREE = 50.0
"""Squared difference in standard deviations above which two views are not both inliers."""
_IMPOSSIBLE = 60.0
"""Difference in -2 log from the most likely state beyond which a state is not considered."""
_ITERATIONS = 5
"""Iterations of the mean of several poses."""
_EXACT = np.diag(np.repeat([1e-8, 1e-8], 3))
"""Covariance of start poses, which are known, (6, 6), [m, rad]."""


class Merged(NamedTuple):
    """The pose that the views of one operation indicate together, under an assumed state."""

    goal: Array | None
    """(4, 4), world, [m]; None if all views are rejected."""
    covariance: Array
    """(6, 6), [m, rad]; `ROOM` if all views are rejected."""
    surprise: float
    """-2 log of the probability of state and views, relative to one inlier, without contacts."""


Sightings = tuple[tuple[Sighting, ...], ...]
"""The views of each operation."""


def views_of(observation: Observation, model: OutlierModel | None = None) -> Sightings:
    """The views of a first observation, at most one per operation."""
    return add_views(((),) * len(observation.poses), observation, observation, model)


def add_views(
    views: Sightings, observation: Observation, first: Observation, model: OutlierModel | None = None
) -> Sightings:
    """The views with those of another observation added.

    Args:
        observation: The new observation; operations that it did not observe get no view.
        first: The first observation, from which poses before each operation are taken.
        model: Gives the position of the camera, if known.
    """
    assembly = observation.assembly
    mains = [operation.main for operation in assembly.operations]
    before = _before(first)
    look = 1 + max((view.look for own in views for view in own), default=-1)
    grown = list[tuple[Sighting, ...]]()
    for k, old in enumerate(views):
        if not observation.observed[k]:
            grown.append(old)
            continue
        T = observation.poses[k]
        ray = None
        if model is not None and model.camera_m is not None:
            to = T[:3, :3].T @ (T[:3, 3] - np.array(model.camera_m))
            ray = to / max(float(np.linalg.norm(to)), 1e-9)
        others = [i for i in range(len(mains)) if mains[i] != mains[k] and observation.observed[i]]
        like = [i for i in others if assembly.solids[mains[i]] is assembly.solids[mains[k]]]
        flips = find_approximate_symmetries(assembly.solids[mains[k]]).turns
        unlike = [i for i in others if i not in like]
        seen = Sighting(T, observation.covariance[k], flips, before[k], ray, (*like, *unlike), len(like), look)
        grown.append((*old, seen))
    return tuple(grown)


def _before(first: Observation) -> list[tuple[Array, Array] | None]:
    """Pose of the main part before each operation, and its covariance; None if that pose was not observed."""
    now: dict[str, Array | None] = dict.fromkeys(first.start, _EXACT)
    found = list[tuple[Array, Array] | None]()
    where = (first.start, *compute_placements(first.assembly, first.start, first.poses)) if first.start else ()
    for k, operation in enumerate(first.assembly.operations):
        C = now.get(operation.main)
        found.append(None if C is None else (where[k][operation.main], C))
        for part in operation.moves:
            now[part] = first.covariance[k] if first.observed[k] else None
    return found


def merge_views(
    views: Sequence[Sighting], state: State, model: OutlierModel, shown: Sequence[Sighting] | None = None
) -> Merged:
    """Merge the views of one operation under a state.

    Args:
        shown: The view that each belief is about, as `views_by_state` returns them; default: `views`.
    """
    pairs = zip(shown or views, state, strict=True)
    assumed = [interpret_view(view, belief, model) for view, belief in pairs if not says_nothing(belief)]
    unlikely = surprise(views, state, model)
    anywhere = log_volume(ROOM)
    if not assumed:
        return Merged(None, ROOM, unlikely + anywhere * max(0, len(views) - 1))
    unlikely += anywhere * (len(views) - len(assumed))
    if len(assumed) == 1:
        return Merged(*assumed[0], unlikely)
    goal, covariance, length = _mean(assumed)
    apart = sum(log_volume(C) for _, C in assumed) - log_volume(covariance)
    return Merged(goal, covariance, unlikely + length + apart)


def views_by_state(views: Sightings, k: int, state: State) -> tuple[Sighting, ...]:
    """The views of operation k that its state names; in place of a swapped one, the other operation's view of that
    observation.
    """
    return tuple(
        view if belief >= 0 else next(other for other in views[swapped_with(belief)] if other.look == view.look)
        for view, belief in zip(views[k], state, strict=False)
    )


def beliefs(views: Sequence[Sighting], model: OutlierModel) -> list[tuple[float, State]]:
    """States of the views of one operation, each view inlier, stale or gross, with their surprises; the best first.

    Very unlikely states are left out, but never those that reject all views. Ties go to the state that trusts the
    latest view, since an operation is observed again for a reason.
    """
    m = len(views)
    groups: set[tuple[int, ...]] = {()}
    if m <= _MOST_TOGETHER:
        groups.update(g for size in range(1, m + 1) for g in combinations(range(m), size))
    else:
        groups.update(tuple(j for j in range(m) if i == j or _agree(views[i], views[j])) for i in range(m))
    false = [_false(view, model) for view in views]
    rated = []
    for group in groups:
        state = tuple(INLIER if i in group else false[i] for i in range(m))
        rated.append((round(merge_views(views, state, model).surprise, 6), tuple(-i for i in group[::-1]), state))
    likely = min(rated)[0] + _IMPOSSIBLE
    return [
        (unlikely, state) for unlikely, _, state in sorted(rated) if unlikely < likely or all(map(says_nothing, state))
    ]


def _false(view: Sighting, model: OutlierModel) -> int:
    """The more likely belief, stale or gross, of a rejected view."""
    if view.before is None:
        return GROSS
    return min((GROSS, STALE), key=lambda belief: surprise((view,), (belief,), model))


def _agree(a: Sighting, b: Sighting) -> bool:
    """Whether two views may both be inliers."""
    xi = pose.log(pose.inverse(a.goal) @ b.goal)
    return float(xi @ np.linalg.solve(a.covariance + b.covariance, xi)) < _AGREE


def confused_with(views: Sightings, operations: Sequence[int]) -> set[int]:
    """The operations with a view that agrees with one of the later views of some operations."""
    return {
        i
        for k in operations
        for view in views[k][1:]
        for i in views[k][0].others
        if any(_agree(view, other) for other in views[i])
    }


def _mean(views: Sequence[tuple[Array, Array]]) -> tuple[Array, Array, float]:
    """The most likely pose of several Gaussians, its covariance, and the sum of squared deviations from it."""
    poses = np.array([goal for goal, _ in views])
    W = np.linalg.inv([C for _, C in views])
    C = np.linalg.inv(W.sum(axis=0))
    T = poses[-1]
    for _ in range(_ITERATIONS):
        T = T @ pose.exp(C @ np.einsum("kij,kj->i", W, pose.log(pose.inverse(T) @ poses)))
    xi = pose.log(pose.inverse(T) @ poses)
    return T, (C + C.T) / 2, float(np.einsum("ki,kij,kj->", xi, W, xi))
