"""Whether a matrix is a pose at all."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

_ONE = np.eye(4)
_TOLERANCE = 1e-6
"""How far R R^t may be from the identity."""
FARTHEST_M = 1e4
"""Nothing is farther from the origin: beyond it, rounding is no longer small."""


def is_rigid(T: ArrayLike) -> NDArray[np.bool_]:
    """Whether each matrix, (n, 4, 4), is a proper rigid displacement, -> (n,); numbers that are not finite are not."""
    T = np.asarray(T, dtype=np.float64)
    finite = np.isfinite(T).all(axis=(1, 2))
    if not finite.all():
        T = np.where(finite[:, None, None], T, 0.0)
    R = T[:, :3, :3]
    square = np.abs(R @ np.swapaxes(R, 1, 2) - _ONE[:3, :3]).max(axis=(1, 2)) < _TOLERANCE
    last_row = np.abs(T[:, 3] - _ONE[3]).max(axis=1) < _TOLERANCE
    return np.asarray(finite & square & last_row & (np.linalg.det(R) > 0.0))
