"""Plausible places for parts that contacts leave partly free: touching what they should, and intruding into nothing.

Contacts fix part of the pose of an operation whose observation was left out. What they leave free is chosen among a few
places around the inferred one. The best has the fewest contacts whose faces do not overlap, then the least penetration,
then the largest overlap.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation, compute_placements, measure_round_pair
from apo_bench.correction.solvers import settle_basis
from apo_bench.geometry import Array, Face, RoundFace, compute_overlap_area, measure_face_area, measure_intrusion, pose

PLACES_TRIED = 24
"""Number of places that are tried for all operations together."""
LEAST_PLACES = 8
"""Least number of places that are tried for each operation."""
_COVERED = 0.02
"""Least overlap of faces in contact, as a fraction of the smaller face."""
_FREE_M = 2e-3
"""Standard deviation above which a direction counts as free, [m]."""
_WEIGHTS = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])
"""Scales of a twist: a radian counts as much as 50 mm."""
_EQUAL = 1e-6
"""Relative difference of variances up to which they are equal."""
_DEEP_M = 5e-4
"""Penetration of parts that should not touch, up to which it does not count, [m]."""


class Crowding(NamedTuple):
    """How implausible consistent poses are; smaller is better, compared field by field."""

    missed: int
    """Number of contacts whose faces do not overlap."""
    depth: float
    """Sum of the penetration depths of parts that should not touch, [m]."""
    bare: float
    """Sum over the contacts of the fraction of the smaller face that is not covered."""


def crowding(observation: Observation, poses: Array, best: Crowding | None = None) -> Crowding | None:
    """Measure how implausible the poses, (n, 4, 4), are.

    Returns:
        None as soon as the poses are found to be worse than `best`.
    """
    assembly = observation.assembly
    at = compute_placements(assembly, observation.start, poses)
    missed = 0
    bare = 0.0
    for operation, placed in zip(assembly.operations, at, strict=True):
        for m, e in dict.fromkeys(map(assembly.given, operation.contacts)):
            covered = _covered(assembly.face_of(m), placed[m.part], assembly.face_of(e), placed[e.part])
            bare = bare + 1.0 - covered
            missed = missed + (covered < _COVERED)
            if best is not None and missed > best.missed:
                return None
    depth = 0.0
    for operation, placed in zip(assembly.operations, at, strict=True):
        touching = {frozenset((m.part, e.part)) for m, e in operation.contacts}
        for part in operation.moves:
            for other in assembly.solids:
                if other not in operation.moves and frozenset((part, other)) not in touching:
                    deep = measure_intrusion(assembly.solids[part], placed[part], assembly.solids[other], placed[other])
                    depth += deep if deep > _DEEP_M else 0.0
        if best is not None and (missed, depth) > best[:2]:
            return None
    return Crowding(missed, depth, bare)


def _covered(a: Face | RoundFace, T_a: Array, b: Face | RoundFace, T_b: Array) -> float:
    """The fraction of the smaller of two faces in contact that is covered, 0 to 1; of the length, for round faces."""
    if isinstance(a, Face) and isinstance(b, Face):
        return compute_overlap_area(a, T_a, b, T_b) / min(measure_face_area(a), measure_face_area(b))
    return measure_round_pair(a, T_a, b, T_b).share


def places(goal: Array, covariance: Array, number: int) -> Iterator[Array]:
    """Yield poses around one, (4, 4) each, spread evenly over its free directions, the nearest first.

    Args:
        goal: The inferred pose, (4, 4), [m].
        covariance: (6, 6), of its body twist, [m, rad].
        number: How many poses to yield.
    """
    from scipy.stats import norm, qmc

    w, V = np.linalg.eigh(covariance * np.outer(_WEIGHTS, _WEIGHTS))
    free = w > _FREE_M**2
    if not free.any():
        return
    # Halton points, spread evenly, as normal deviates along the free axes of the covariance. Within a group of equal
    # variances rounding would decide which axes eigh returns, so each group gets a basis that its span determines.
    w = w[free]
    V = V[:, free]
    new = np.flatnonzero(np.diff(w) > _EQUAL * w[1:]) + 1
    axes = np.hstack([settle_basis(group) for group in np.split(V, new, axis=1)])
    z = norm.ppf(qmc.Halton(int(free.sum()), scramble=False).random(number + 1)[1:])
    twists = (z[np.argsort((z * z).sum(axis=1))] * np.sqrt(w)) @ axes.T / _WEIGHTS
    yield from goal @ pose.exp(twists)


def least_crowded(
    observation: Observation,
    poses: Array,
    covariance: Array,
    doubted: tuple[int, ...],
    solve: Callable[[Array], Array | None],
) -> Array | None:
    """The most plausible of the consistent poses that are tried for the doubted operations.

    Args:
        poses: (n, 4, 4), consistent.
        covariance: (n, 6, 6), of their body twists, [m, rad].
        doubted: The operations whose observation was left out.
        solve: Takes poses with some of them moved, (n, 4, 4), to consistent poses; None if there are none.

    Returns:
        None if nothing is wrong with the given poses, or none that were tried are better.
    """
    best = crowding(observation, poses)
    assert best is not None
    roomiest = None
    for k in doubted:
        if best.missed == 0 and best.depth == 0.0:
            break
        base = poses if roomiest is None else roomiest
        for T in places(base[k], covariance[k], max(LEAST_PLACES, PLACES_TRIED // len(doubted))):
            moved = np.array(base)
            moved[k] = T
            consistent = solve(moved)
            now = None if consistent is None else crowding(observation, consistent, best)
            if now is not None and now < best:
                best = now
                roomiest = consistent
    return roomiest
