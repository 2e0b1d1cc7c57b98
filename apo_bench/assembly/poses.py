"""Poses of all parts, by name, and how operations change them."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from apo_bench.assembly.topology import Assembly
from apo_bench.errors import require_known
from apo_bench.geometry import Array, pose

Poses = Mapping[str, Array]
"""Part name -> pose (4, 4) in the world, [m]."""


def compute_placements(assembly: Assembly, start: Poses, poses: Array) -> tuple[Poses, ...]:
    """The pose of every part after each operation, as its ODL gives it (Section 3.2.1).

    Args:
        start: Poses before the first operation, world frame, [m].
        poses: (n, 4, 4), world frame, [m].

    Returns:
        One mapping per operation; a part that was not moved yet is at its start.
    """
    history: list[Poses] = []
    odls = dict(start)
    for operation, goal in zip(assembly.operations, poses, strict=True):
        before = odls[operation.main]
        odls = dict(odls)
        # A carried part keeps its pose relative to the main part: T_world_carried = T_goal T_before^-1 T_world_carried.
        for part in operation.carries:
            odls[part] = goal @ pose.inverse(before) @ odls[part]
        odls[operation.main] = goal
        history.append(MappingProxyType(odls))
    return tuple(history)


def list_alternatives(poses: Poses) -> list[Poses]:
    """Split poses with several alternatives into one mapping, (4, 4) per part, for each alternative.

    Args:
        poses: (r, 4, 4) for parts that have r alternatives, (4, 4) for parts with one pose in all of them.
    """
    count = max((len(T) for T in poses.values() if T.ndim == 3), default=1)
    every = {part: np.broadcast_to(T, (count, 4, 4)) for part, T in poses.items()}
    return [{part: T[i] for part, T in every.items()} for i in range(count)]


def check_parts(assembly: Assembly, *placed: Poses) -> None:
    """Raise an `InputError` if poses are of a part that the assembly does not have."""
    for part in {part: None for poses in placed for part in poses}:
        require_known("part in the poses", part, assembly.solids)
