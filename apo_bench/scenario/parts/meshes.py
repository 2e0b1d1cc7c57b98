"""Make convex pieces from the corners in part files, and check that they are convex."""

from pathlib import Path

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array, Hull

_SAME_M = 1e-7
"""Corners nearer to each other are repeated; a corner farther inside the convex hull makes the piece not convex."""
_THINNEST_M = 1e-5
"""Least thickness of a piece across each of its sides."""


def make_hull(path: Path, name: str, corners: Array) -> Hull:
    """Make the piece with these corners.

    Args:
        path: The part file, for messages.
        corners: (k, 3), [m].

    Raises:
        InputError: A corner is repeated or inside the convex hull, or all corners lie in a plane.
    """
    from scipy.spatial import QhullError, cKDTree

    repeated = cKDTree(corners).query_pairs(_SAME_M)
    require(not repeated, f"{path}: piece '{name}' has a corner twice; remove one of the two.")
    hull = Hull(name, corners)
    try:
        # Depth of each corner below each side, (sides, corners).
        below = hull.planes[:, 3] - corners @ hull.planes[:, :3].T
    except QhullError:
        below = np.zeros((1, 1))
    require(
        below.max(axis=0).min() >= _THINNEST_M,
        f"{path}: piece '{name}' is flat: a piece is thicker than {1e3 * _THINNEST_M:g} mm across each side.",
    )
    inside = below.min(axis=1)
    require(
        inside.max() <= _SAME_M,
        f"{path}: piece '{name}' is not convex: its corner {int(inside.argmax()) + 1} lies "
        f"{1e3 * inside.max():.3g} mm inside of the others; cut it into convex pieces.",
    )
    return hull
