"""What a camera looks at, and from how far, to see parts as large as they fit."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, measure_world_bounds

_NEAREST_M = 0.09
"""How far the camera stands off: this and the diagonal of what it looks at."""


class Framing(NamedTuple):
    """A point, (3,), world frame, and how far the camera is from it, [m]."""

    look_at: Array
    distance_m: float


def frame_parts(
    assembly: Assembly, states: Sequence[Poses], parts: Collection[str] | None = None, headroom_m: float = 0.0
) -> Framing:
    """See parts in several states.

    Args:
        parts: None stands for all that are ever moved.
        headroom_m: What is seen above them.
    """
    shown = assembly.solids.keys() - assembly.fixed if parts is None else parts
    low, high = measure_world_bounds((assembly.solids[part], poses[part]) for poses in states for part in sorted(shown))
    high = high + np.array([0.0, 0.0, headroom_m])
    return Framing((low + high) / 2, _NEAREST_M + float(np.linalg.norm(high - low)))
