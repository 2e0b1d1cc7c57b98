"""How deep a plan puts parts into one another: at the goal, on the way in, and where that way begins."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from apo_bench.assembly import Assembly, Operation, Poses
from apo_bench.geometry import (
    Array,
    Solid,
    enclose_in_ball,
    measure_intrusion_depths,
    remember,
    shrink_pieces,
)
from apo_bench.planning.insertion.attach import Attach

_SPACING_M = 0.02
"""Largest distance between two places on the way in that are examined, up to `_MOST` places."""
_MOST = 8
"""Places on the way in that are examined, at most."""
_ABOVE_M = np.linspace(0.0, 0.04, 9)
"""Heights above the begin of a level way in that are examined, (9,), since a part comes down there."""
_LEVEL = 0.5
"""A way in is level if its cosine with the vertical is smaller."""
FAR_M = 0.01
"""Parts that are further apart count as so far apart."""
Solids = Mapping[str, Solid]


@remember
def physical_solids(assembly: Assembly, clearance_mm: float) -> Solids:
    """The parts as they are made, fit faces receded; the same ones each time."""
    made = {
        name: replace(solid, pieces=shrink_pieces(solid, clearance_mm * 1e-3))
        for name, solid in assembly.solids.items()
    }
    return MappingProxyType(made)


def depths_on_way(operation: Operation, planned: Poses, how: Attach | None, physical: Solids) -> list[Array]:
    """How deep each part that moves comes into each one that rests and that it should not touch, (r,) each, [m].

    Args:
        planned: Every part where the plan has it after the operation, (4, 4), or where r robots bring it, (r, 4, 4).
        how: The way in; without it the goal alone is looked at.

    Returns:
        Negative: how far off they stay.
    """
    touching = {frozenset((m.part, e.part)) for m, e in operation.contacts}
    back = _way_back(planned[operation.main], how)
    pairs = [pair for pair in _pairs(operation, physical) if frozenset(pair) not in touching]
    return [_deepest(physical[a], planned[a], physical[b], planned[b], back) for a, b in pairs]


def depths_from_above(operation: Operation, planned: Poses, how: Attach | None, physical: Solids) -> list[Array]:
    """How deep each part comes into each one that rests while it comes down to where a level way in begins, [m].

    Parts that it touches in the end count, too: there it has not come into them yet.

    Returns:
        As `depths_on_way`; `-FAR_M` of any other way in.
    """
    pairs = _pairs(operation, physical)
    goals = planned[operation.main].reshape(-1, 4, 4)
    none = np.full(len(goals), -FAR_M)
    if how is None:
        return [none] * len(pairs)
    ways = goals[:, :3, :3] @ how.direction
    level = np.abs(ways[:, 2]) < _LEVEL
    if not level.any():
        return [none] * len(pairs)
    down = _ABOVE_M[:, None] * np.array([0.0, 0.0, 1.0]) - how.travel_m * ways[:, None]
    deepest = [_deepest(physical[a], planned[a], physical[b], planned[b], down) for a, b in pairs]
    return [np.where(level, each, none) for each in deepest]


def _pairs(operation: Operation, physical: Solids) -> list[tuple[str, str]]:
    return [(a, b) for a in operation.moves for b in physical if b not in operation.moves]


def _deepest(a: Solid, T_a: Array, b: Solid, T_b: Array, shifts: Array) -> Array:
    """The deepest intrusion over all displacements (r, k, 3) of a, of each of r robots, [m]; far off ones are skipped.

    Args:
        T_a, T_b: (4, 4), or (r, 4, 4).
    """
    T_a, T_b = (np.broadcast_to(T, (len(shifts), 4, 4)) for T in (T_a, T_b))
    middle, radius = enclose_in_ball(a.pieces)
    places = (T_a[:, :3, :3] @ middle + T_a[:, :3, 3] - T_b[:, :3, 3])[:, None] + shifts
    seen_from_b = places @ T_b[:, :3, :3]
    near = np.linalg.norm(seen_from_b - np.clip(seen_from_b, *b.bounds), axis=2) < radius + FAR_M
    out = np.full(len(shifts), -FAR_M)
    for i in near.any(axis=1).nonzero()[0]:
        at = T_a[i, :3, 3] + shifts[i, near[i]]
        depths = measure_intrusion_depths(a.pieces, T_a[i, :3, :3], at, b.pieces, T_b[i], FAR_M)
        out[i] = max(-FAR_M, float(depths.max()))
    return out


def _way_back(goal: Array, how: Attach | None) -> Array:
    """From goals, (4, 4) or (r, 4, 4), back along the way in, (r, k, 3), world, [m]."""
    goals = goal.reshape(-1, 4, 4)
    if how is None:
        return np.zeros((len(goals), 1, 3))
    k = min(_MOST, 1 + int(np.ceil(how.travel_m / _SPACING_M)))
    ways = goals[:, :3, :3] @ how.direction
    return -np.linspace(0.0, how.travel_m, k)[:, None] * ways[:, None]
