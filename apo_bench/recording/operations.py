"""What a log shows of one operation: where its part went, by which way, and what moved with it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.recording.log import Track
from apo_bench.recording.ordering import quiet, taken
from apo_bench.recording.paths import Path, path_of
from apo_bench.recording.rests import Rest
from apo_bench.recording.stays import Stay, Stays, poses_at


@final
@dataclass(frozen=True, eq=False)
class Seen:
    """One operation as the log shows it."""

    stay: Stay | None
    """Where its main part stayed; None if it was not seen."""
    rest: Rest | None
    """The rest of it that is the goal: that at which the next operation began."""
    path: Path | None
    """Of the main part, from its stay before to this one, world."""
    carried: Mapping[str, Array]
    """Carried part -> the body twist by which it moved in the hand, (6,), [m, rad]."""
    adjusted: Mapping[str, Array]
    """Part that the operation does not move -> the body twist by which it was moved all the same, (6,)."""


def seen_operation(
    tracks: Mapping[str, Track],
    stays: Stays,
    chosen: Sequence[Stay | None],
    assembly: Assembly,
    T_world_camera: Array,
    k: int,
) -> Seen:
    """Operation k, counted from 0.

    Args:
        tracks: Of parts, camera from part.
        chosen: The stay with which each operation ends.
    """
    operation = assembly.operations[k]
    stay = chosen[k]
    if stay is None:
        return Seen(None, None, None, {}, {})
    over = quiet(assembly, stays, chosen, k)
    rest = stay.at(over)
    begins = taken(assembly, stays, chosen[:k], stay)
    path = path_of(tracks[operation.main], begins, rest.begins, T_world_camera)
    before = poses_at(stays, begins)
    after = poses_at(stays, over)
    moved = pose.inverse(before[operation.main]) @ after[operation.main]
    carried = {}
    adjusted = {}
    for part in stays:
        if part == operation.main:
            continue
        own = pose.inverse(before[part]) @ after[part]
        if part in operation.carries:
            together = before[operation.main] @ moved @ pose.inverse(before[operation.main]) @ before[part]
            carried[part] = pose.log(pose.inverse(together) @ after[part])
        elif np.abs(pose.log(own)).max() > 0.0:
            adjusted[part] = pose.log(own)
    return Seen(stay, rest, path, carried, adjusted)
