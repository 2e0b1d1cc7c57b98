"""Where parts stand before the first operation: on known places, as the scenario's do where they were seen, or else."""

from collections.abc import Mapping

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array

_HIGH_M = 0.01
_TILTED_DEG = 10.0
"""A part that was seen so much higher or more tilted stands otherwise."""


def starts(seen: Poses, known: Mapping[str, Array | None], planned: Poses) -> tuple[Poses, Mapping[str, str]]:
    """Where every part starts, and whence that is known: `known`, `seen`, `otherwise` or `scenario`.

    Args:
        seen: Of tracked parts, world, [m].
        known: Places that were stated; None: as planned.
        planned: Of all parts.
    """
    start = dict(planned)
    whence = dict.fromkeys(planned, "scenario")
    for part, T in seen.items():
        if part in known:
            place = known[part]
            start[part] = planned[part] if place is None else place
            whence[part] = "known"
            continue
        stands = standing(planned[part], T)
        start[part], whence[part] = (T, "otherwise") if stands is None else (stands, "seen")
    return start, whence


def standing(planned: Array, seen: Array) -> Array | None:
    """Place and turn on the table as seen, height and tilt as planned, (4, 4); None if it stood otherwise."""
    R = seen[:3, :3] @ planned[:3, :3].T
    turn = float(np.degrees(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])))
    made = np.array(pose.at((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ planned)
    made[:2, 3] = seen[:2, 3]
    made[2, 3] = planned[2, 3]
    off = pose.log(pose.inverse(made) @ seen)
    if abs(seen[2, 3] - planned[2, 3]) > _HIGH_M or np.degrees(np.linalg.norm(off[3:])) > _TILTED_DEG:
        return None
    return made
