"""Where on a line parts overlap, from all pairs of their pieces: what swept parts are held against."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry import Array, PosedPieces
from apo_bench.geometry.solid import all_boxes
from apo_bench.geometry.swept import _TOUCH_DEPTH_M, _WHOLE_LINE, _overlap_interval_of_pair, _overlap_intervals_of_boxes


def overlap_intervals(
    moving: PosedPieces,
    way: Array,
    resting: PosedPieces,
    slack_m: float = _TOUCH_DEPTH_M,
    within: tuple[float, float] = _WHOLE_LINE,
) -> Array:
    """Where along a line the pieces of two parts overlap by more than a slack, (k, 2), [m]: from and until.

    Args:
        way: Unit vector of the motion, (3,), world.
        slack_m: Negative: pieces count that are still this far apart.
        within: Overlaps that end before or begin after these places may be left out, [m].
    """
    pairs, spans = _overlap_intervals_of_boxes(moving, way, resting, slack_m, within)
    if all_boxes(moving.pieces) and all_boxes(resting.pieces):
        return spans
    near = (spans[:, 1] > within[0]) & (spans[:, 0] < within[1])
    exact = [_overlap_interval_of_pair(moving, way, resting, slack_m, int(k)) for k in pairs[near]]
    return np.concatenate([np.zeros((0, 2)), *exact])
