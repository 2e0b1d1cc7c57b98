"""Whether a surface crosses itself: a tree of boxes finds triangles that may meet, their edges say which do."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from apo_bench.cad.raw import Mesh
from apo_bench.geometry.arrays import Array

_AT_ONCE = 200_000
_OF_TWO = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
_INSIDE = 1e-6
"""Crossings nearer to an edge than this part of a triangle are touches."""


def crossing(mesh: Mesh, off: Array | None = None) -> Array | None:
    """A point, (3,), at which two triangles without a common corner cross; None if none do.

    Args:
        off: How far each triangle may be from the surface that it stands for, (t,): triangles that cross by no more
            than that of both say nothing of the surfaces.
    """
    tolerance = 1e-6 * mesh.extent
    for some in _near(mesh):
        a, b = mesh.triangles[some.T]
        apart = (a[:, :, None] != b[:, None, :]).all(axis=(1, 2))
        least = np.full(int(apart.sum()), tolerance) + (0.0 if off is None else off[some[apart]].sum(axis=1))
        for one, other in ((a[apart], b[apart]), (b[apart], a[apart])):
            found = _through(mesh.corners[one], mesh.corners[other], least)
            if found is not None:
                return found
    return None


def _near(mesh: Mesh) -> Iterator[Any]:
    """Pairs of triangles whose boxes overlap, (p, 2), some at a time."""
    points = mesh.corners[mesh.triangles]
    low = points.min(axis=1)
    high = points.max(axis=1)
    order = _in_space((low + high) / 2.0)
    levels = int(np.ceil(np.log2(max(len(order), 2))))
    room = 1 << levels
    tree = [(np.full((room, 3), np.inf), np.full((room, 3), -np.inf))]
    tree[0][0][: len(order)] = low[order]
    tree[0][1][: len(order)] = high[order]
    for _ in range(levels):
        lows, highs = tree[-1]
        tree.append((np.minimum(lows[::2], lows[1::2]), np.maximum(highs[::2], highs[1::2])))
    open_ = [(levels, np.zeros((1, 2), dtype=np.int64))]
    while open_:
        level, pairs = open_.pop()
        if level == 0:
            yield order[pairs[pairs[:, 0] < pairs[:, 1]]]
            continue
        lows, highs = tree[level - 1]
        every = np.concatenate([2 * pairs + off for off in _OF_TWO])
        every = every[every[:, 0] <= every[:, 1]]
        i, k = every.T
        every = every[((lows[i] <= highs[k]) & (lows[k] <= highs[i])).all(axis=1)]
        open_ += [(level - 1, every[first : first + _AT_ONCE]) for first in range(0, len(every), _AT_ONCE)]


def _in_space(points: Array) -> Any:
    """The order of points along a curve that keeps neighbours together."""
    span = np.maximum(np.ptp(points, axis=0), 1e-12)
    cell = ((points - points.min(axis=0)) / span * 1023.0).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _through(a: Array, b: Array, tolerance: Array) -> Array | None:
    """Where an edge of a triangle goes through the inside of another one; both (p, 3, 3).

    Args:
        tolerance: What is nearer only touches, (p,).
    """
    n = np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
    size = np.linalg.norm(n, axis=1)
    n = n / np.maximum(size, 1e-300)[:, None]
    height = ((a - b[:, :1]) * n[:, None]).sum(axis=2)
    may = (height.max(axis=1) > tolerance) & (height.min(axis=1) < -tolerance) & (size > tolerance**2)
    a = a[may]
    b = b[may]
    n = n[may]
    height = height[may]
    size = size[may]
    tolerance = tolerance[may]
    for i in range(3):
        k = (i + 1) % 3
        through = ((height[:, i] > tolerance) & (height[:, k] < -tolerance)) | (
            (height[:, i] < -tolerance) & (height[:, k] > tolerance)
        )
        if not through.any():
            continue
        p = a[through, i]
        q = a[through, k]
        corners = b[through]
        m = n[through]
        area = size[through]
        near = tolerance[through]
        share = height[through, i] / (height[through, i] - height[through, k])
        x = p + share[:, None] * (q - p)
        inside = np.ones(len(x), dtype=bool)
        for j in range(3):
            start = corners[:, j]
            end = corners[:, (j + 1) % 3]
            inside &= (np.cross(end - start, x - start) * m).sum(axis=1) > _INSIDE * area + near * np.linalg.norm(
                end - start, axis=1
            )
        if inside.any():
            return np.asarray(x[inside][0])
    return None
