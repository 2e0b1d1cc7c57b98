"""Penetration depths between parts of a plan: at the goal, along the line of attach, and above its beginning."""

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
from apo_bench.planning.insertion.attach_line import Attach

_SPACING_M = 0.02
"""Largest spacing of the examined positions on the line of attach, unless that takes more than `_MOST`."""
_MOST = 8
"""Largest number of examined positions on the line of attach."""
_ABOVE_M = np.linspace(0.0, 0.04, 9)
"""Examined heights above the beginning of a level line, (9,), [m]; the part descends there."""
_LEVEL = 0.5
"""A line of attach is level if its cosine with the vertical is smaller."""
FAR_M = 0.01
"""Larger distances between parts count as this one."""
Solids = Mapping[str, Solid]


@remember
def make_physical_solids(assembly: Assembly, clearance_mm: float) -> Solids:
    """The parts as manufactured: fit faces recede by `clearance_mm`. Cached per assembly and clearance."""
    made = {
        name: replace(solid, pieces=shrink_pieces(solid, clearance_mm * 1e-3))
        for name, solid in assembly.solids.items()
    }
    return MappingProxyType(made)


def measure_depths_on_line(operation: Operation, planned: Poses, how: Attach | None, physical: Solids) -> list[Array]:
    """Penetration of each moving part into each resting part that it has no contact with, (r,) each, [m].

    Args:
        operation: The operation that moves the parts.
        planned: Pose of every part after the operation, (4, 4), or (r, 4, 4) for r robots with different errors.
        how: The line of attach; None: only the goal is examined.
        physical: From `make_physical_solids`.

    Returns:
        One array per pair of parts: the deepest over the examined positions; a negative depth is a distance.
    """
    touching = {frozenset((m.part, e.part)) for m, e in operation.contacts}
    back = _list_retreat_shifts(planned[operation.main], how)
    pairs = [pair for pair in _list_part_pairs(operation, physical) if frozenset(pair) not in touching]
    return [_measure_deepest(physical[a], planned[a], physical[b], planned[b], back) for a, b in pairs]


def measure_depths_from_above(
    operation: Operation, planned: Poses, how: Attach | None, physical: Solids
) -> list[Array]:
    """Penetration of each moving part into each resting part while it descends to the beginning of a level line, [m].

    Parts that are in contact at the goal count, too, since the contact is not made yet.

    Returns:
        As `measure_depths_on_line`; `-FAR_M` if the line is not level, or there is none.
    """
    pairs = _list_part_pairs(operation, physical)
    goals = planned[operation.main].reshape(-1, 4, 4)
    none = np.full(len(goals), -FAR_M)
    if how is None:
        return [none] * len(pairs)
    ways = goals[:, :3, :3] @ how.direction
    level = np.abs(ways[:, 2]) < _LEVEL  # z component of the line, per alternative
    if not level.any():
        return [none] * len(pairs)
    # Displacements of the moving part: back to the beginning of the line, then up.
    down = _ABOVE_M[:, None] * np.array([0.0, 0.0, 1.0]) - how.travel_m * ways[:, None]
    deepest = [_measure_deepest(physical[a], planned[a], physical[b], planned[b], down) for a, b in pairs]
    return [np.where(level, each, none) for each in deepest]


def _list_part_pairs(operation: Operation, physical: Solids) -> list[tuple[str, str]]:
    """(moving part, resting part) of all combinations."""
    return [(a, b) for a in operation.moves for b in physical if b not in operation.moves]


def _measure_deepest(a: Solid, T_a: Array, b: Solid, T_b: Array, shifts: Array) -> Array:
    """The largest penetration of solid `a` into `b` over all displacements of `a`, (r,), [m]; at least `-FAR_M`.

    Args:
        T_a, T_b: World poses, (4, 4), or (r, 4, 4) of r alternatives.
        shifts: Displacements of `a`, (r, k, 3), world frame, [m].
    """
    T_a, T_b = (np.broadcast_to(T, (len(shifts), 4, 4)) for T in (T_a, T_b))
    middle, radius = enclose_in_ball(a.pieces)  # bounding ball of a, in its frame
    places = (T_a[:, :3, :3] @ middle + T_a[:, :3, 3] - T_b[:, :3, 3])[:, None] + shifts
    seen_from_b = places @ T_b[:, :3, :3]
    # Only displacements that bring the bounding ball of a near the bounding box of b are measured exactly.
    near = np.linalg.norm(seen_from_b - np.clip(seen_from_b, *b.bounds), axis=2) < radius + FAR_M
    out = np.full(len(shifts), -FAR_M)
    for i in near.any(axis=1).nonzero()[0]:
        at = T_a[i, :3, 3] + shifts[i, near[i]]
        depths = measure_intrusion_depths(a.pieces, T_a[i, :3, :3], at, b.pieces, T_b[i], FAR_M)
        out[i] = max(-FAR_M, float(depths.max()))
    return out


def _list_retreat_shifts(goal: Array, how: Attach | None) -> Array:
    """Displacements from goals, (4, 4) or (r, 4, 4), back along the line of attach, (r, k, 3), world frame, [m]."""
    goals = goal.reshape(-1, 4, 4)
    if how is None:
        return np.zeros((len(goals), 1, 3))
    k = min(_MOST, 1 + int(np.ceil(how.travel_m / _SPACING_M)))
    ways = goals[:, :3, :3] @ how.direction
    return -np.linspace(0.0, how.travel_m, k)[:, None] * ways[:, None]
