"""Where every part stands: poses by part, and how operations change them."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from apo_bench.assembly.topology import Assembly
from apo_bench.errors import require_known
from apo_bench.geometry import Array, pose

Poses = Mapping[str, Array]
"""Part name -> pose (4, 4) in the world, [m]."""


def compute_placements(assembly: Assembly, start: Poses, poses: Array) -> tuple[Poses, ...]:
    """The pose of every part after each operation, what an ODL stands for (Section 3.2.1), by walking the operations.

    Args:
        start: Poses before the first operation, world frame, [m].
        poses: (n, 4, 4), world frame, [m].

    Returns:
        One mapping per operation; a part that was not moved yet stands where it started.
    """
    history: list[Poses] = []
    now = dict(start)
    for operation, goal in zip(assembly.operations, poses, strict=True):
        before = now[operation.main]
        now = dict(now)
        # What is carried keeps its place on the main part: T_world_carried = T_goal T_before^-1 T_world_carried.
        for part in operation.carries:
            now[part] = goal @ pose.inverse(before) @ now[part]
        now[operation.main] = goal
        history.append(MappingProxyType(now))
    return tuple(history)


def list_alternatives(poses: Poses) -> list[Poses]:
    """The poses of each of several alternatives, (4, 4) per part.

    Args:
        poses: Of all, (r, 4, 4), or (4, 4) of parts that have one pose in all of them; at least one alternative.
    """
    count = max((len(T) for T in poses.values() if T.ndim == 3), default=1)
    every = {part: np.broadcast_to(T, (count, 4, 4)) for part, T in poses.items()}
    return [{part: T[i] for part, T in every.items()} for i in range(count)]


def check_parts(assembly: Assembly, *placed: Poses) -> None:
    """Raise an `InputError` if poses are of a part that the assembly does not have."""
    for part in {part: None for poses in placed for part in poses}:
        require_known("part in the poses", part, assembly.solids)
