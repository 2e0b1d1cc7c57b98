"""Where every part stands after each operation, if the goals are reached exactly."""

from types import MappingProxyType

from apo_bench.assembly.goals import Poses
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array


def placements(assembly: Assembly, start: Poses, goals: Array) -> tuple[Poses, ...]:
    """The pose of every part after each operation, what an ODL stands for (Section 3.2.1), by walking the operations.

    Args:
        start: Poses before the first operation, world frame, [m].
        goals: (n, 4, 4), world frame, [m].

    Returns:
        One mapping per operation; a part that was not moved yet stands where it started.
    """
    history: list[Poses] = []
    now = dict(start)
    for operation, goal in zip(assembly.operations, goals, strict=True):
        before = now[operation.main]
        now = dict(now)
        for part in operation.carries:
            now[part] = goal @ pose.inverse(before) @ now[part]
        now[operation.main] = goal
        history.append(MappingProxyType(now))
    return tuple(history)
