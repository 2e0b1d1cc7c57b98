"""Close cracks of no width: where corners of one side of an edge lie inside the edge of the other side."""

from itertools import pairwise

import numpy as np

from apo_bench.geometry import Array
from apo_bench.importers.cad.solids import Mesh

_ON_EDGE = 1e-5
"""A corner this near to an edge lies on it, as a share of the size of the mesh."""
_PASSES = 3  # a triangle may have three such edges


def close_cracks(mesh: Mesh) -> Mesh:
    """Return a mesh whose triangles at open edges are divided at the corners that lie on these edges.

    The surface stays the same; holes with an area stay open.
    """
    for _ in range(_PASSES):
        divided = _divide_triangles(mesh)
        if divided is None:
            break
        mesh = divided
    return mesh


def _divide_triangles(mesh: Mesh) -> Mesh | None:
    """Return the mesh with one open edge of each triangle divided; None if there is nothing to divide."""
    keys, first, counts = np.unique(np.sort(mesh.sides, axis=1), axis=0, return_index=True, return_counts=True)
    border = np.unique(keys[counts == 1])
    near = _ON_EDGE * mesh.extent
    new = list[tuple[int, int, int]]()
    replaced = set[int]()
    for side in first[counts == 1].tolist():
        t = side % len(mesh.triangles)
        i, k = mesh.sides[side].tolist()
        between = _list_corners_between(mesh.corners, border, i, k, near)
        if between and t not in replaced:
            tip = next(c for c in mesh.triangles[t].tolist() if c not in (i, k))
            chain = [i, *between, k]
            new += [(a, b, tip) for a, b in pairwise(chain)]
            replaced.add(t)
    if not replaced:
        return None
    return Mesh(mesh.corners, np.concatenate([np.delete(mesh.triangles, sorted(replaced), axis=0), np.array(new)]))


def _list_corners_between(corners: Array, border: Array, i: int, k: int, near: float) -> list[int]:
    """Return the border corners inside the edge from corner i to corner k, in this order."""
    along = corners[k] - corners[i]
    length = float(np.linalg.norm(along))
    off = corners[border] - corners[i]
    height = off @ (along / length)
    distance = np.linalg.norm(off - np.outer(height, along / length), axis=1)
    inside = (distance < near) & (height > near) & (height < length - near)
    return [int(c) for c in border[inside][np.argsort(height[inside])]]
