"""Where triangles of a mesh cross each other."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.geometry import Array

_AT_ONCE = 200_000
_OF_TWO = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
_TRIES = 4
_DIGITS = 7
_BEYOND = 1e-5
"""A corner that is moved out of a triangle is beyond its plane by so much of the size."""
_INSIDE = 1e-6
"""Crossings nearer to an edge than this part of a triangle are touches."""


def crossings(mesh: Mesh, off: Array | None = None) -> Iterator[tuple[Any, Array]]:
    """Pairs of triangles without a common corner that cross, (p, 2), some at a time, and where, (p, 3).

    Args:
        off: How far each triangle may be from the surface that it stands for, (t,): triangles that cross by no more
            than that of both say nothing of the surfaces.
    """
    tolerance = 1e-6 * mesh.extent
    for pairs in _near(mesh):
        a, b = mesh.triangles[pairs.T]
        apart = (a[:, :, None] != b[:, None, :]).all(axis=(1, 2))
        least = np.full(int(apart.sum()), tolerance) + (0.0 if off is None else off[pairs[apart]].sum(axis=1))
        for edges, sheets in ((a[apart], b[apart]), (b[apart], a[apart])):
            which, where = _through(mesh.corners[edges], mesh.corners[sheets], least)
            if len(which):
                yield pairs[apart][which], where


def uncrossed(mesh: Mesh, most: float) -> Mesh:
    """The mesh with corners moved back out of triangles that they pierce, by no more than that, as far as that does.

    Args:
        most: [mm].
    """
    new = mesh
    for _ in range(_TRIES):
        pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *(found for found, _ in crossings(new))])
        corners = new.corners.copy()
        for pair in pairs:
            # Corners of that triangle which reaches less far through the other one go back to where most of it is.
            ways = []
            for edges, sheet in (pair, pair[::-1]):
                n = mesh.across[sheet] / np.linalg.norm(mesh.across[sheet])
                height = (corners[mesh.triangles[edges]] - corners[mesh.triangles[sheet, 0]]) @ n
                side = np.sign(height[np.abs(height).argmax()])
                off = np.minimum(side * height - _BEYOND * mesh.extent, 0.0)
                ways.append((round(-off.min() / mesh.extent, _DIGITS), mesh.triangles[edges], np.outer(side * off, n)))
            _, which, way = min(ways, key=lambda each: each[0])
            corners[which] -= way
        new = Mesh(corners, mesh.triangles)
    return new if np.linalg.norm(new.corners - mesh.corners, axis=1).max() < most else mesh


def _near(mesh: Mesh) -> Iterator[Any]:
    """Pairs of triangles whose boxes overlap, (p, 2), some at a time."""
    from scipy.spatial import cKDTree

    points = mesh.corners[mesh.triangles]
    low = points.min(axis=1)
    high = points.max(axis=1)
    order = cKDTree((low + high) / 2.0, leafsize=1).indices  # that keeps neighbours together
    # A box is its lowest corner and minus its highest one, (6,), so the box around two boxes is their minimum.
    levels = int(np.ceil(np.log2(max(len(order), 2))))
    leaves = np.full((1 << levels, 6), np.inf)
    leaves[: len(order)] = np.hstack([low, -high])[order]
    tree = [leaves]
    for _ in range(levels):
        tree.append(np.minimum(tree[-1][::2], tree[-1][1::2]))
    # From the root down, each pair of boxes that overlap is opened into the four pairs of what is in them.
    open_pairs = [(levels, np.zeros((1, 2), dtype=np.int64))]
    while open_pairs:
        level, pairs = open_pairs.pop()
        if level == 0:
            yield order[pairs[pairs[:, 0] < pairs[:, 1]]]
            continue
        every = np.concatenate([2 * pairs + off for off in _OF_TWO])
        every = every[every[:, 0] <= every[:, 1]]
        i, k = tree[level - 1][every.T]
        every = every[((i[:, :3] <= -k[:, 3:]) & (k[:, :3] <= -i[:, 3:])).all(axis=1)]
        open_pairs += [(level - 1, every[first : first + _AT_ONCE]) for first in range(0, len(every), _AT_ONCE)]


def _through(a: Array, b: Array, tolerance: Array) -> tuple[Any, Array]:
    """Which first triangles have an edge through the inside of the second one, (q,), and where, (q, 3); both (p, 3, 3).

    Args:
        tolerance: What is nearer only touches, (p,).
    """
    # Heights of the corners of a over the plane of b; an edge goes through where they have different signs.
    n = np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
    size = np.linalg.norm(n, axis=1)
    n = n / np.maximum(size, 1e-300)[:, None]
    height = ((a - b[:, :1]) * n[:, None]).sum(axis=2)
    above = height > tolerance[:, None]
    below = height < -tolerance[:, None]
    found = []
    for i in range(3):
        k = (i + 1) % 3
        through = ((above[:, i] & below[:, k]) | (below[:, i] & above[:, k])) & (size > tolerance**2)
        if not through.any():
            continue
        start = a[through, i]
        share = height[through, i] / (height[through, i] - height[through, k])
        x = start + share[:, None] * (a[through, k] - start)
        # x is inside of b if it is left of each of its edges, seen against n: (edge x (x - corner)) . n is the length
        # of the edge times the distance from it.
        corners = b[through]
        edges = np.roll(corners, -1, axis=1) - corners
        left = (np.cross(edges, x[:, None] - corners) * n[through][:, None]).sum(axis=2)
        margin = tolerance[through][:, None] * np.linalg.norm(edges, axis=2)
        inside = (left > _INSIDE * size[through][:, None] + margin).all(axis=1)
        found.append((np.flatnonzero(through)[inside], x[inside]))
    which, where = zip(*found, strict=True) if found else ([np.zeros(0, dtype=np.intp)], [np.zeros((0, 3))])
    return np.concatenate(which), np.concatenate(where)
