"""Choose point and distance of a camera so that parts fill the picture."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, measure_world_bounds

_NEAREST_M = 0.09
"""Distance of the camera, added to the diagonal of the parts' bounding box."""


class Framing(NamedTuple):
    """The point that a camera looks at, (3,), world frame, and its distance from it, [m]."""

    look_at: Array
    distance_m: float


def frame_parts(
    assembly: Assembly, states: Sequence[Poses], parts: Collection[str] | None = None, headroom_m: float = 0.0
) -> Framing:
    """The framing that shows parts in several states.

    Args:
        states: Poses of all parts in each state.
        parts: None: all movable parts.
        headroom_m: Visible space above the parts.
    """
    shown = assembly.solids.keys() - assembly.fixed if parts is None else parts
    low, high = measure_world_bounds((assembly.solids[part], poses[part]) for poses in states for part in sorted(shown))
    high = high + np.array([0.0, 0.0, headroom_m])
    return Framing((low + high) / 2, _NEAREST_M + float(np.linalg.norm(high - low)))
