"""Where parts may be of which too little was seen: beside the others, not inside them, and well on what they lie on.

Contacts fix a part of the goal that was left out. What they leave free is chosen among a few places about the one
that was inferred: the one where parts are least inside each other, and of these the one where faces cover most.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from apo_bench.assembly.goals import Observation
from apo_bench.assembly.placement import placements
from apo_bench.correction.robust.hypotheses import UNKNOWN
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import intrusion
from apo_bench.geometry.overlap import face_area, overlap

TRIED = 24
"""Places that are tried for one operation."""
_DEEP_M = 5e-4
"""Parts that should not touch may be so deep in each other before another place is tried."""


def crowding(observation: Observation, goals: Array) -> tuple[float, float]:
    """How much parts are in each other's way if the goals, (n, 4, 4), are reached exactly.

    Returns:
        The sum of the depths of parts that should not touch, [m], 0 where none is deep; and how much of the smaller
        face contacts leave bare, all together.
    """
    assembly, depth, bare = observation.assembly, 0.0, 0.0
    for operation, at in zip(assembly.operations, placements(assembly, observation.start, goals), strict=True):
        touching = {frozenset((m.part, e.part)) for m, e in operation.contacts}
        for part in operation.moves:
            for other in assembly.solids:
                if other not in operation.moves and frozenset((part, other)) not in touching:
                    deep = intrusion(assembly.solids[part], at[part], assembly.solids[other], at[other])
                    depth += deep if deep > _DEEP_M else 0.0
        for m, e in operation.contacts:
            faces = assembly.face(m), assembly.face(e)
            found = overlap(faces[0], at[m.part], faces[1], at[e.part])
            bare += 1.0 - found.area / min(map(face_area, faces))
    return depth, bare


def places(goal: Array) -> Iterator[Array]:
    """Poses about one, (4, 4) each: spread evenly as far as an inferred goal may be off, the nearest first."""
    from scipy.stats import norm, qmc

    z = norm.ppf(qmc.Halton(6, scramble=False).random(TRIED + 1)[1:])
    twists = z[np.argsort((z * z).sum(axis=1))] * np.sqrt(np.diag(UNKNOWN))
    yield from goal @ pose.exp(twists)


def least_crowded(
    observation: Observation, goals: Array, doubted: tuple[int, ...], solve: Callable[[Array], Array | None]
) -> Array | None:
    """Goals at which parts are out of each other's way, as far as places that are tried allow.

    Args:
        goals: (n, 4, 4), consistent.
        doubted: The operations whose observation was left out.
        solve: Goals as they are inferred, (n, 4, 4) -> consistent goals, or None where there are none.

    Returns:
        None if the given goals are as good as any that were tried, or nobody is in the way.
    """
    best, found = crowding(observation, goals), None
    for k in doubted:
        if best[0] == 0.0:
            break
        base = goals if found is None else found
        for T in places(base[k]):
            moved = np.array(base)
            moved[k] = T
            made = solve(moved)
            if made is not None and (now := crowding(observation, made)) < best:
                best, found = now, made
    return found
