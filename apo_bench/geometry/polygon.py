"""Closed rings of points in a plane."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry.arrays import Array

_STRAIGHT_M = 1e-9
"""A point this near to the line through its neighbours is no corner."""


def straightened(ring: Array) -> Array:
    """The corners of a closed ring (k, 2), each once, [m]: points in the middle of straight edges are dropped."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    chord = np.maximum(np.linalg.norm(before + after, axis=1), _STRAIGHT_M)
    return ring[np.abs(across) > _STRAIGHT_M * chord]
