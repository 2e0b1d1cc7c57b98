"""What may be assumed of one view, and how likely that is before contacts count.

A view is an inlier, seen with the stated noise; broad, seen with some times that; shifted, too near or too far;
flipped, turned as a part that nearly looks the same after that turn may be; swapped with that of another operation;
displaced together with views of neighbours; stale, where the part was before; or gross, anywhere. The last two say
nothing of the pose.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import betaln

from apo_bench.assembly import OutlierModel
from apo_bench.geometry import Array, copy_frozen, pose

INLIER = 0
BROAD = 1
GROSS = 2
SHIFTED = 3
STALE = 4
DISPLACED = 5
FLIPPED = 6
"""By the first of the turns of its part; the next number by the next one. Swapped are below 0, see `swapped_with`."""
State = tuple[int, ...]
"""One of these for each view of an operation; empty if it was never seen."""
States = tuple[State, ...]
"""Those of the views of each operation."""
SHIFT_M = 0.04
"""Standard deviation of what is too near or too far, [m]."""
VIEW = copy_frozen(np.diag(np.repeat([0.02, np.radians(5.0)], 3) ** 2))
"""(6, 6), of what displaces several operations together, about their middle, [m, rad]."""
ROOM = copy_frozen(np.diag(np.repeat([0.5, (8.0 * np.pi**2) ** (1 / 3)], 3) ** 2 / (2.0 * np.pi)))
"""(6, 6): a Gaussian as dense in its middle as poses anywhere in half a metre, turned anyhow, are; [m, rad]."""
_SURE_OF_RATE = 5.0
"""The rate of gross observations that is stated counts like so many operations."""


class Sighting(NamedTuple):
    """An operation as it was observed once."""

    goal: Array
    """(4, 4)."""
    covariance: Array
    """(6, 6), [m, rad]."""
    flips: Array
    """(m, 4, 4), body displacements after which its part nearly looks the same."""
    before: tuple[Array, Array] | None = None
    """Where its part was before, (4, 4), and the covariance of that, (6, 6); None if that is not known."""
    ray: Array | None = None
    """(3,), the ray on which it was observed, in the frame of the part; None if that is not known."""
    others: tuple[int, ...] = ()
    """Operations whose view may have been exchanged for this one."""


def swapped_with(k: int) -> int:
    """The belief that a view is that of another operation; and back."""
    return -1 - k


def says_nothing(belief: int) -> bool:
    """Whether a view that is assumed so tells nothing of the pose."""
    return belief in (GROSS, STALE)


def alternatives(view: Sighting) -> list[int]:
    """What may be assumed of a view by itself."""
    stale = [] if view.before is None else [STALE]
    return [INLIER, BROAD, GROSS, SHIFTED, *stale, *range(FLIPPED, FLIPPED + len(view.flips))]


def interpret_view(view: Sighting, belief: int, model: OutlierModel) -> tuple[Array, Array]:
    """What a view that is assumed so says of the pose: a pose, (4, 4), and its covariance, (6, 6)."""
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
    """How often a view is so, relative to how often it is an inlier."""
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
        return float(np.sqrt(model.gross / inlier * swap / len(view.others)))
    if belief == GROSS:
        return model.gross / inlier * (1.0 - swap - turned - sum(kinds.values()))
    return model.gross / inlier * (kinds[belief] if belief in kinds else turned / flips)


def log_volume(covariance: Array) -> float:
    """-2 log of the density of a Gaussian in its middle."""
    return float(np.linalg.slogdet(2.0 * np.pi * covariance)[1])


def unlikelihood(apart: Array, covariance: Array) -> float:
    """-2 log of how dense a Gaussian is at a twist, (6,), relative to poses that may be anywhere."""
    square = float(apart @ np.linalg.solve(covariance, apart))
    return square + log_volume(covariance) - log_volume(ROOM)


def surprise(views: Sequence[Sighting], state: State, model: OutlierModel) -> float:
    """-2 log of how likely a state of the views of one operation is, relative to inliers; and of the views, as far as
    that does not depend on the pose."""
    total = 0.0
    for j, (view, belief) in enumerate(zip(views, state, strict=True)):
        chance = share(view, belief, model)
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
    """How dense a view is that repeats what was false in an earlier one, relative to poses that may be anywhere."""
    if belief >= FLIPPED:
        return float(belief == assumed)
    if not says_nothing(belief):
        return 0.0
    # What repeats is where the earlier view is, within the noise of both.
    apart = pose.log(pose.inverse(earlier.goal) @ view.goal)
    return float(np.exp(-0.5 * unlikelihood(apart, earlier.covariance + view.covariance)))


def is_false(belief: int) -> bool:
    """Whether a view that is assumed so is wrong by more than noise."""
    return belief not in (INLIER, BROAD)


def together(states: States, model: OutlierModel) -> float:
    """What the states of all operations are likelier together than one by one, in -2 log, with the opposite sign.

    The rate of gross observations is not known exactly: a beta distribution about the stated one is integrated over.
    Of operations that are displaced together there is one range among all.
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
