"""Prior model of observations: the possible states of one view, and how likely each is before contacts count.

A view is one observation of an operation. Its state, a belief, is one of:

- inlier: noise as stated;
- broad: noise several times as large as stated;
- shifted: too near or too far;
- flipped: turned as a part may be that nearly looks the same after that turn;
- swapped: exchanged with the view of another operation;
- displaced: displaced together with the views of neighbouring operations;
- stale: where the part was before;
- gross: anywhere.

Stale and gross views tell nothing of the pose. "Surprise" is -2 log of a probability.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import betaln

from apo_bench.assembly import OutlierModel
from apo_bench.geometry import Array, copy_frozen, pose

INLIER = 0
"""Noise as stated."""
BROAD = 1
"""Noise `OutlierModel.times` as large as stated."""
GROSS = 2
"""Anywhere."""
SHIFTED = 3
"""Too near or too far."""
STALE = 4
"""Where the part was before."""
DISPLACED = 5
"""Displaced together with neighbouring operations."""
FLIPPED = 6
"""Turned by the first approximate symmetry of its part; FLIPPED + i: by symmetry i. Negative: see `swapped_with`."""
State = tuple[int, ...]
"""The belief of each view of one operation; empty if the operation was never observed."""
States = tuple[State, ...]
"""The state of every operation."""
SHIFT_M = 0.04
"""Standard deviation of the distance error of a shifted view, [m]."""
VIEW = copy_frozen(np.diag(np.repeat([0.02, np.radians(5.0)], 3) ** 2))
"""Covariance of a displacement that several operations share, about their mean position, (6, 6), [m, rad]."""
ROOM = copy_frozen(np.diag(np.repeat([0.5, (8.0 * np.pi**2) ** (1 / 3)], 3) ** 2 / (2.0 * np.pi)))
"""Covariance of a Gaussian that is as dense at its centre as poses anywhere in half a metre, of any rotation, (6, 6),
[m, rad]."""
ALIKE = 0.75
"""Share of the exchanges that are between parts of equal shape, for a part that has such and others."""
_SURE_OF_RATE = 5.0
"""Number of operations that the stated rate of gross observations counts for as prior evidence."""


class Sighting(NamedTuple):
    """One view: a single observation of one operation."""

    goal: Array
    """The observed pose of the main part, (4, 4), world, [m]."""
    covariance: Array
    """(6, 6), [m, rad]."""
    flips: Array
    """(m, 4, 4), approximate symmetries of the part (`find_approximate_symmetries`)."""
    before: tuple[Array, Array] | None = None
    """Pose of the part before the operation, (4, 4), and its covariance, (6, 6); None if unknown."""
    ray: Array | None = None
    """Direction from the camera to the part, unit vector, (3,), frame of the part; None if unknown."""
    others: tuple[int, ...] = ()
    """Operations whose view may have been exchanged with this one, those on parts of equal shape first."""
    alike: int = 0
    """How many of these are on parts of equal shape."""
    look: int = 0
    """Number of the observation that this view is of; 0 is the first."""


def swapped_with(k: int) -> int:
    """The belief, a negative number, that a view is swapped with that of operation k; also its inverse."""
    return -1 - k


def says_nothing(belief: int) -> bool:
    """Whether a view with this belief tells nothing of the pose."""
    return belief in (GROSS, STALE)


def alternatives(view: Sighting) -> list[int]:
    """The beliefs that are possible for a view by itself, without other operations."""
    stale = [] if view.before is None else [STALE]
    return [INLIER, BROAD, GROSS, SHIFTED, *stale, *range(FLIPPED, FLIPPED + len(view.flips))]


def interpret_view(view: Sighting, belief: int, model: OutlierModel) -> tuple[Array, Array]:
    """The true pose that a view with some belief indicates, (4, 4), and the covariance of its body twist, (6, 6)."""
    if belief == BROAD:
        return view.goal, view.covariance * model.times**2
    if belief == SHIFTED:
        along = np.eye(3) if view.ray is None else np.outer(view.ray, view.ray)
        C = np.array(view.covariance)
        C[:3, :3] += SHIFT_M**2 * along
        return view.goal, C
    if belief >= FLIPPED:
        # The true pose is T F where T was observed, so a body twist xi at T is Ad(F^-1) xi there.
        F = view.flips[belief - FLIPPED]
        A = pose.adjoint(pose.inverse(F))
        C = A @ view.covariance @ A.T
        return view.goal @ F, (C + C.T) / 2
    return view.goal, view.covariance


def share(view: Sighting, belief: int, model: OutlierModel) -> float:
    """Prior probability of a belief of a view, relative to that of an inlier."""
    inlier = 1.0 - model.gross - model.broad
    flips = len(view.flips)
    kinds = {SHIFTED: model.shift, STALE: model.stale if view.before is not None else 0.0}
    swap = model.swap if view.others else 0.0
    turned = model.flip if flips else 0.0
    if belief in (INLIER, DISPLACED):
        return 1.0
    if belief == BROAD:
        return model.broad / inlier
    if belief < 0:
        # Two views are exchanged at once, so each is charged for half of it.
        return float(np.sqrt(model.gross / inlier * swap * _share_of_pair(view, swapped_with(belief))))
    if belief == GROSS:
        return model.gross / inlier * (1.0 - swap - turned - sum(kinds.values()))
    return model.gross / inlier * (kinds[belief] if belief in kinds else turned / flips)


def _share_of_pair(view: Sighting, k: int) -> float:
    """The share of the exchanges of a view that are with that of operation k."""
    unlike = len(view.others) - view.alike
    if not view.alike or not unlike:
        return 1.0 / len(view.others)
    return ALIKE / view.alike if k in view.others[: view.alike] else (1.0 - ALIKE) / unlike


def log_volume(covariance: Array) -> float:
    """-2 log of the density of a Gaussian with this covariance at its centre."""
    return float(np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def unlikelihood(apart: Array, covariance: Array) -> float:
    """-2 log of the density of a Gaussian at a twist, (6,), relative to that of poses anywhere (`ROOM`)."""
    square = float(apart @ np.linalg.solve(covariance, apart))
    return square + log_volume(covariance) - log_volume(ROOM)


def surprise(views: Sequence[Sighting], state: State, model: OutlierModel) -> float:
    """-2 log of the probability of the state of the views of one operation, relative to inliers.

    The density of stale views and of repeated false views is included, since that does not depend on the pose.
    """
    total = 0.0
    for j, (view, belief) in enumerate(zip(views, state, strict=True)):
        chance = share(view, belief, model)
        # After a false view, a later one repeats the error with probability `model.repeat`.
        false = [i for i in range(j) if is_false(state[i])]
        if false:
            again = np.mean([_alike(views[i], state[i], view, belief) for i in false])
            chance = (1.0 - model.repeat) * chance + model.repeat * float(again)
        total -= 2.0 * float(np.log(max(chance, 1e-300)))
        if belief == STALE and view.before is not None:
            T, C = view.before
            total += unlikelihood(pose.log(pose.inverse(T) @ view.goal), C + view.covariance)
    return total


def _alike(earlier: Sighting, assumed: int, view: Sighting, belief: int) -> float:
    """Density of a view that repeats the error of an earlier one, relative to poses anywhere.

    Args:
        earlier, assumed: The earlier view and its belief.
        view, belief: The later view and its belief.
    """
    if belief >= FLIPPED or belief < 0:
        return float(belief == assumed)
    if not says_nothing(belief):
        return 0.0
    # What repeats is where the earlier view is, within the noise of both.
    apart = pose.log(pose.inverse(earlier.goal) @ view.goal)
    return float(np.exp(-0.5 * unlikelihood(apart, earlier.covariance + view.covariance)))


def is_false(belief: int) -> bool:
    """Whether a view with this belief is off by more than noise."""
    return belief not in (INLIER, BROAD)


def together(states: States, model: OutlierModel) -> float:
    """Correction of the surprise of all states for being judged together, instead of independently.

    The rate of gross observations is uncertain: it is integrated over a beta distribution about the stated rate.
    Operations that are displaced together count as one event, one range of operations among all possible ones.
    """
    n = len(states)
    first = [state[0] for state in states if state]
    false = sum(is_false(belief) and belief != DISPLACED for belief in first)
    a = _SURE_OF_RATE * model.gross
    b = _SURE_OF_RATE - a
    known = false * np.log(model.gross) + (len(first) - false) * np.log1p(-model.gross)
    total = -2.0 * float(betaln(a + false, b + len(first) - false) - betaln(a, b) - known)
    if DISPLACED in first:
        total -= 2.0 * float(np.log(model.view / (1.0 - model.view) / max(1, n * (n - 1) // 2)))
    return total
