"""Merge corners of triangles that are at the same place, [mm]."""

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from apo_bench.importers.cad.solids import Mesh, find_connected_groups

SAME_CORNER = 1e-7
"""Corners nearer to each other than this are the same, as a share of the size of the mesh."""


def merge_corners(mesh: Mesh, near: float) -> tuple[Mesh, Any]:
    """Merge near corners into the first of them.

    Args:
        near: Largest distance of corners that are merged, [mm].

    Returns:
        The mesh without triangles that collapsed, and which triangles were kept, (t,).
    """
    corners, index = np.unique(mesh.corners, axis=0, return_inverse=True)
    _, group = find_connected_groups(cKDTree(corners).query_pairs(near, output_type="ndarray"), len(corners))
    first = np.unique(group, return_index=True)[1]
    triangles = group[index.ravel()][mesh.triangles]
    a, b, c = triangles.T
    has_three = (a != b) & (b != c) & (c != a)
    return Mesh(corners[first], triangles[has_three]), has_three
