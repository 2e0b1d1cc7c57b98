"""Closed rings of points in a plane."""

import numpy as np

from apo_bench.geometry.arrays import Array

_STRAIGHT_M = 1e-9
"""A point this near to the line through its neighbours is no corner."""


def straightened(ring: Array) -> Array:
    """The corners of a closed ring (k, 2), each once, [m]: points in the middle of straight edges are dropped.

    A sliver, such as a disc seen nearly edge-on, keeps its points where no three corners would be left.
    """
    before = ring - np.roll(ring, 1, axis=0)
    after = np.roll(ring, -1, axis=0) - ring
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    chord = np.maximum(np.linalg.norm(before + after, axis=1), _STRAIGHT_M)
    corners = ring[np.abs(across) > _STRAIGHT_M * chord]
    return corners if len(corners) > 2 else ring
