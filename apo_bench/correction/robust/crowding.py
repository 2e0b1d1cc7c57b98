"""Where parts may be that were hardly observed: next to the others, not inside them, and well on what they lie on.

Contacts fix a part of the pose that was left out. What they leave free is chosen among a few places about the one
that was inferred: the one where faces of contacts cover each other, then where parts are least inside each other, and
of these the one where faces cover most.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Observation, compute_placements, measure_round
from apo_bench.correction.solvers import settle_basis
from apo_bench.geometry import Array, Face, RoundFace, compute_overlap_area, measure_face_area, measure_intrusion, pose

PLACES_TRIED = 24
LEAST_PLACES = 8
"""Places that are tried for all operations together, and for each at least."""
_COVERED = 0.02
"""Faces that touch cover at least this part of the smaller one."""
_FREE_M = 2e-3
_WEIGHTS = np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])
"""A direction is free if the pose may be off by more than this along it, [m]; a radian weighs as much as 50 mm."""
_EQUAL = 1e-6
"""Variances that differ by less than this part are equal but for rounding."""
_DEEP_M = 5e-4
"""Parts that should not touch may be so deep in each other before another place is tried."""


class Crowding(NamedTuple):
    """What is wrong with poses that satisfy all equations, the worst first."""

    missed: int
    """Contacts whose faces do not cover each other."""
    depth: float
    """The sum of the depths of parts that should not touch, [m]; 0 where none is deep."""
    bare: float
    """How much of the smaller face contacts leave bare, all together."""


def crowding(observation: Observation, poses: Array, best: Crowding | None = None) -> Crowding | None:
    """How much parts are in each other's way, or next to each other, if the poses, (n, 4, 4), are reached exactly.

    Returns:
        None if that is worse than `best`, as soon as that is known.
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
    """How much of the smaller of two faces that touch covers the other one, 0 to 1; of round ones, of their length."""
    if isinstance(a, Face) and isinstance(b, Face):
        return compute_overlap_area(a, T_a, b, T_b) / min(measure_face_area(a), measure_face_area(b))
    return measure_round(a, T_a, b, T_b).share


def places(goal: Array, covariance: Array, number: int) -> Iterator[Array]:
    """Poses about one, (4, 4) each: spread evenly over what is free of it, the nearest first.

    Args:
        covariance: (6, 6), of the body twist by which it may be wrong, [m, rad].
    """
    from scipy.stats import norm, qmc

    w, V = np.linalg.eigh(covariance * np.outer(_WEIGHTS, _WEIGHTS))
    free = w > _FREE_M**2
    if not free.any():
        return
    # Halton points, spread evenly, as normal deviates along the free axes of the covariance. Axes that are as free as
    # each other are any of their span, so rounding would decide which: they are settled together.
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
    """Poses at which parts touch that should, and no others, as far as places that are tried allow.

    Args:
        poses: (n, 4, 4), consistent.
        covariance: (n, 6, 6), of the body twists by which they may be wrong, [m, rad].
        doubted: The operations whose observation was left out.
        solve: Poses as they are inferred, (n, 4, 4) -> consistent poses, or None where there are none.

    Returns:
        None if the given poses are as good as any that were tried, or nothing is wrong with them.
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
