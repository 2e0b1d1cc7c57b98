"""The turns after which a part looks the same."""

from functools import lru_cache
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.exact_turns import exact_turns
from apo_bench.geometry.polygon import across_axis
from apo_bench.geometry.pose import apply
from apo_bench.geometry.revolution import revolution, turn_about, turned_alike
from apo_bench.geometry.solid import Solid, all_boxes

_SAME_M = 1e-6
"""Corners of boxes that are nearer than this have the same coordinate."""


@lru_cache(maxsize=1)
def quarter_turns() -> Array:
    """The rotations that carry the axes of a frame onto each other, (24, 3, 3), the identity first."""
    rotations = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            R = np.zeros((3, 3))
            R[range(3), order] = signs
            if np.linalg.det(R) > 0.0:
                rotations.append(R)
    turns = np.array(rotations)
    turns.flags.writeable = False
    return turns


@lru_cache(maxsize=256)
def symmetries(solid: Solid) -> Array:
    """The displacements g of a solid that leave the space it fills as it is, (m, 4, 4), the identity first.

    Fit faces lie on fit faces then, too: a part that recedes on one side only does not look the same from both.
    A union of axis-aligned boxes has faces towards both ends of all three axes and no others, so a turn that leaves it
    as it is carries axes onto axes: the 24 quarter turns about the centre of volume are all that can. Names of faces
    do not count. Seen at `T g` it looks as it does at `T`.

    A solid of other pieces or with round faces is turned by where its faces can go (`exact_turns`). Of a part of
    revolution, which has any number of them, those are here that turn its axis: none but the identity, or one more.
    """
    if solid.rounds or not all_boxes(solid.pieces):
        kept = _of_any_pieces(solid)
        kept.flags.writeable = False
        return kept
    c = solid.centroid
    centred = [(box.center - c, box.half) for box in solid.pieces]
    turned = [R for R in quarter_turns() if _same(centred, [(R @ at, np.abs(R) @ half) for at, half in centred])]
    # x -> R x + (c - R c): the turn about the centre of volume.
    g = np.tile(np.eye(4), (len(turned), 1, 1))
    g[:, :3, :3] = turned
    g[:, :3, 3] = c - np.array(turned) @ c
    kept = g[[_keeps_fit(solid, T) for T in g]]
    kept.flags.writeable = False
    return kept


def _of_any_pieces(solid: Solid) -> Array:
    about = revolution(solid)
    if about is None:
        return exact_turns(solid)
    over = turn_about(about.point, across_axis(about.axis), np.pi)
    return np.array([np.eye(4), over] if about.reversible else [np.eye(4)])


def nearest_alike(solid: Solid, T: Array, expected: Array) -> Array:
    """The pose, (4, 4), at which a solid looks as it does at T, turned least away from an expected pose (4, 4).

    Any turn about an axis of revolution looks the same.
    """
    if revolution(solid) is not None:
        return turned_alike(solid, T, expected)
    return np.asarray(T @ nearest_symmetry(symmetries(solid), (pose.inverse(expected) @ T)[None])[0])


def folds(symmetric: Array) -> Array:
    """How often a part looks the same in a whole turn about each axis of its frame, (3,): 1, 2 or 4.

    Args:
        symmetric: (m, 4, 4), from `symmetries`.
    """
    return np.array([1.0 + sum(R[i, i] == 1.0 for R in symmetric[1:, :3, :3]) for i in range(3)])


def nearest_symmetry(symmetric: Array, off: Array) -> Array:
    """For each displacement (n, 4, 4), the symmetry g (n, 4, 4) for which `off @ g` turns the least.

    Of several that are as good the first is taken, which is the identity wherever that is one of them.
    """
    # trace(R) = 1 + 2 cos(angle): the least turn has the greatest trace.
    traces = np.einsum("nij,mji->nm", off[:, :3, :3], symmetric[:, :3, :3])
    close = traces >= traces.max(axis=1, keepdims=True) - 1e-12
    return np.asarray(symmetric[np.argmax(close, axis=1)])


def nearest_symmetric_pose(T: Array, symmetric: Array, expected: Array) -> Array:
    """The pose T g, (4, 4), that looks like T and is turned least away from an expected rotation (3, 3)."""
    poses = T @ symmetric
    return np.asarray(poses[np.einsum("nij,ij->n", poses[:, :3, :3], expected).argmax()])


def _same(a: list[tuple[Array, Array]], b: list[tuple[Array, Array]]) -> bool:
    """Whether two unions of boxes, each a centre and half sizes, fill the same space: cell by cell of their grid."""
    cuts = [_cuts(np.array([at[i] + s * half[i] for at, half in a + b for s in (-1.0, 1.0)])) for i in range(3)]
    middles = [(cut[1:] + cut[:-1]) / 2 for cut in cuts]
    return bool(np.array_equal(_filled(a, middles), _filled(b, middles)))


def _keeps_fit(solid: Solid, g: Array) -> bool:
    """Whether a displacement that leaves the space as it is carries every fit face onto a fit face."""
    fit = [face for face in solid.faces.values() if face.fit]
    return all(any(_same_corners(apply(g, face.outline), other.outline) for other in fit) for face in fit)


def _same_corners(a: Array, b: Array) -> bool:
    """Whether two outlines, (n, 3) and (m, 3), have the same corners, wherever they begin."""
    far = np.linalg.norm(a[:, None] - b[None], axis=-1)
    return bool(len(a) == len(b) and (far.min(axis=0) < _SAME_M).all() and (far.min(axis=1) < _SAME_M).all())


def _cuts(values: Array) -> Array:
    """Sorted, with one of those that are the same."""
    ordered = np.sort(values)
    return ordered[np.append(True, np.diff(ordered) > _SAME_M)]


def _filled(boxes: list[tuple[Array, Array]], middles: list[Array]) -> NDArray[np.bool_]:
    """Which cells, given by their middles along each axis, are in one of the boxes."""
    filled = np.zeros([len(m) for m in middles], dtype=np.bool_)
    for at, half in boxes:
        inside = [np.abs(m - at[i]) < half[i] for i, m in enumerate(middles)]
        filled |= inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]
    return filled
