"""Turns after which a part looks the same."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Box, Solid

SAME_M = 1e-6
"""Planes that are closer together are one plane."""


@lru_cache(maxsize=1)
def quarter_turns() -> Array:
    """The 24 rotations that take coordinate axes to coordinate axes, (24, 3, 3); the identity first."""
    turns = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            R = np.zeros((3, 3))
            R[range(3), order] = signs
            if np.linalg.det(R) > 0:
                turns.append(R)
    found = np.array(turns)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=256)
def symmetries(solid: Solid) -> Array:
    """The rigid displacements (m, 4, 4) that take a solid of boxes into itself; the identity first.

    Every such displacement keeps the centre of volume. Of the turns, quarter turns about the axes of the boxes are
    looked at, which are all there are unless a union of boxes has another symmetry by accident.
    """
    found = []
    for R in quarter_turns():
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, solid.centroid - R @ solid.centroid
        if _same(solid.boxes, [_turned(box, T) for box in solid.boxes]):
            found.append(T)
    same = np.array(found)
    same.flags.writeable = False
    return same


def nearest(T: Array, same: Array, expected: Array) -> Array:
    """Of all poses T S that look the same, (4, 4), the one turned least away from an expected rotation (3, 3)."""
    poses = T @ same
    return np.asarray(poses[np.einsum("nij,ij->n", poses[:, :3, :3], expected).argmax()])


def _turned(box: Box, T: Array) -> Box:
    return Box(box.name, T[:3, :3] @ box.center + T[:3, 3], np.abs(T[:3, :3]) @ box.half)


def _same(a: Sequence[Box], b: Sequence[Box]) -> bool:
    """Whether two unions of boxes are one, decided on the cells between all their planes."""
    middles, sizes = [], []
    for axis in range(3):
        ends = np.sort([box.center[axis] + sign * box.half[axis] for box in (*a, *b) for sign in (-1, 1)])
        middles.append((ends[1:] + ends[:-1]) / 2)
        sizes.append(np.diff(ends) > SAME_M)
    cells = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)
    counts = sizes[0][:, None, None] & sizes[1][:, None] & sizes[2]
    return bool((_inside(a, cells) == _inside(b, cells))[counts].all())


def _inside(boxes: Sequence[Box], points: Array) -> NDArray[np.bool_]:
    inside = np.zeros(points.shape[:-1], dtype=np.bool_)
    for box in boxes:
        inside |= (np.abs(points - box.center) < box.half).all(axis=-1)
    return inside
