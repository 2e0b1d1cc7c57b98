"""Meshes of part files as convex pieces: what is no convex piece with corners of its own is refused."""

from pathlib import Path

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull

_SAME_M = 1e-7
"""Corners nearer to each other are one; a corner this far inside of the piece is none."""
_THINNEST_M = 1e-5
"""A piece is thicker than this across each of its sides."""
_MOST_SIDES = 330
_MOST_DIRECTIONS = 200
"""Of one piece, and of its edges: how deep two of them are in each other is asked along each pair of directions."""


def checked_hull(path: Path, name: str, corners: Array) -> Hull:
    """The piece with these corners, (k, 3), [m].

    Raises:
        InputError: A corner is repeated or inside of the others, or all lie in a plane.
    """
    from scipy.spatial import QhullError, cKDTree

    pairs = sorted(cKDTree(corners).query_pairs(_SAME_M))
    if pairs:
        i, k = pairs[0]
        raise InputError(f"{path}: corners {i + 1} and {k + 1} of piece '{name}' are the same; remove one of them.")
    hull = Hull(name, corners)
    try:
        below = hull.planes[:, 3] - corners @ hull.planes[:, :3].T
    except QhullError:
        below = np.zeros((1, 1))
    if below.max(axis=0).min() < _THINNEST_M:
        raise InputError(
            f"{path}: piece '{name}' is flat: a piece is thicker than {1e3 * _THINNEST_M:g} mm across each side; "
            "give it other corners, or remove it."
        )
    if len(hull.planes) > _MOST_SIDES or len(hull.edges) > _MOST_DIRECTIONS:
        raise InputError(
            f"{path}: piece '{name}' has {len(hull.planes)} sides, and {len(hull.edges)} directions of edges; "
            f"{_MOST_SIDES} and {_MOST_DIRECTIONS} are the most; give it fewer corners, or cut it."
        )
    inside = below.min(axis=1)
    if inside.max() > _SAME_M:
        raise InputError(
            f"{path}: piece '{name}' is not convex: its corner {int(inside.argmax()) + 1} lies "
            f"{1e3 * inside.max():.3g} mm inside of the others; cut it into convex pieces."
        )
    return hull
