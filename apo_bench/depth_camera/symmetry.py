"""Of the poses at which a part looks the same, the one that is expected."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.symmetry import quarter_turns, symmetries

__all__ = ["nearest", "quarter_turns", "symmetries"]


def nearest(T: Array, same: Array, expected: Array) -> Array:
    """Of all poses T S that look the same, (4, 4), the one turned least away from an expected rotation (3, 3)."""
    poses = T @ same
    return np.asarray(poses[np.einsum("nij,ij->n", poses[:, :3, :3], expected).argmax()])
