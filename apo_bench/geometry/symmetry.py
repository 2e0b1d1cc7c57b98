"""The turns after which a part looks the same: few of most parts, any about its axis of a part of revolution."""

from functools import lru_cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, copy_frozen
from apo_bench.geometry.exact_turns import carries_faces, centred_turn, exact_turns, fills_the_same
from apo_bench.geometry.polygon import find_direction_across
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Solid, all_boxes

_SAME_M = 1e-6
"""Corners of boxes that are nearer than this have the same coordinate."""
_ONE_LINE_M = 1e-5
_SAME = 1e-10
"""Lines that are nearer are one line, [m]; cosines nearer to 1 are of one direction."""
_FEWEST = 8
"""Sides of a polygon that may stand for a circle; coarse walls, that no contact needs, have so many."""
_COARSE = 1.0 / np.cos(np.pi / _FEWEST) - 1.0
"""So much of its radius is then in doubt of a wall."""
_TURNS = (0.41, 1.37, 2.71)
"""Turns that carry no polygon of few sides onto itself, [rad]."""
_EVEN = 1e-3
"""Moments of inertia about axes across are the same within this part of their sum."""


class Revolution(NamedTuple):
    """The axis of a part of revolution, in its frame."""

    point: Array
    """(3,), [m]: its centre of volume."""
    axis: Array
    """(3,), unit vector."""
    reversible: bool
    """Whether it is the same end for end, too."""


@lru_cache(maxsize=256)
def find_revolution(solid: Solid) -> Revolution | None:
    """The axis about which a part may be turned by anything; None if it has none.

    All round faces are whole and about this axis, flat ones lie across it and are round themselves, and what the pieces
    fill, and the inertia if it is stated, stay as they are. Round walls are flat ones of pieces, so what these fill is
    known within 8 % of the largest radius.
    """
    rounds = list(solid.rounds.values())
    if not rounds or not all(_about(wall, solid.centroid, rounds[0].axis) for wall in rounds):
        return None
    about = Revolution(solid.centroid, rounds[0].axis, reversible=False)
    for face in solid.faces.values():
        across = abs(face.normal @ about.axis) > 1.0 - _SAME
        if not across or not all(_is_circle(about, loop) for loop in (face.outline, *face.holes)):
            return None
    turns = [make_turn(about.point, about.axis, angle) for angle in _TURNS]
    J = solid.inertia
    R = turns[0][:3, :3]
    if J is not None and np.abs(R @ J @ R.T - J).max() > _EVEN * np.trace(J):
        return None
    coarse = _COARSE * max(max(wall.radii) for wall in rounds)
    if not all(fills_the_same(solid, g, coarse) for g in turns):
        return None
    return about._replace(reversible=carries_faces(solid, _over(about)))


def make_turn(point: Array, axis: Array, angle_rad: float) -> Array:
    """The displacement by a turn about an axis through a point, (4, 4)."""
    spin = np.concatenate([np.zeros(3), axis * angle_rad])
    return np.asarray(pose.at(point) @ pose.exp(spin) @ pose.at(-point))


def find_least_turned(solid: Solid, T: Array, true: Array) -> Array:
    """The pose, (4, 4), at which a part of revolution looks as it does at T, turned the least from another pose.

    Of that one the rotation (3, 3) is enough; of several, (*, 3, 3), each has a pose, (*, 4, 4). Any other part stays
    as it is.
    """
    about = find_revolution(solid)
    if about is None:
        return T
    # What is left between the two, M, is to turn the least: of both ways round, the turn about the axis with the
    # greatest trace. The centre of volume stays where it is observed.
    M = np.swapaxes(true[..., :3, :3], -1, -2) @ T[:3, :3]
    a = about.axis
    across = find_direction_across(a)
    flips = np.array([np.eye(3), 2.0 * np.outer(across, across) - np.eye(3)][: 1 + about.reversible])
    turns = flips @ _least_turn(M[..., None, :, :] @ flips, a)
    traces = np.einsum("...ij,...fji->...f", M, turns)
    best = np.take_along_axis(turns, traces.argmax(axis=-1)[..., None, None, None], axis=-3)[..., 0, :, :]
    return pose.rigid(T[:3, :3] @ best, T[:3, 3] + (about.point - best @ about.point) @ T[:3, :3].T)


def _least_turn(M: Array, axis: Array) -> Array:
    """The rotation about an axis, (*, 3, 3), for which M times it turns the least: the greatest trace."""
    # trace(M R(t)) = c + (trace(M) - a . M a) cos t + trace(M K) sin t, which is greatest at this t.
    K = pose.hat(axis)
    angle = np.arctan2((M * K.T).sum(axis=(-2, -1)), np.trace(M, axis1=-2, axis2=-1) - (M @ axis) @ axis)
    return np.eye(3) + np.sin(angle)[..., None, None] * K + (1.0 - np.cos(angle))[..., None, None] * (K @ K)


def _about(face: RoundFace, point: Array, axis: Array) -> bool:
    """Whether a face goes all around an axis through a point."""
    off = np.cross(face.point - point, axis)
    return bool(face.toward is None and abs(face.axis @ axis) > 1.0 - _SAME and np.sqrt(off @ off) < _ONE_LINE_M)


def _is_circle(about: Revolution, loop: Array) -> bool:
    """Whether corners, (k, 3), lie on a circle about the axis, and are as many as a coarse wall has at least."""
    far = np.linalg.norm(np.cross(loop - about.point, about.axis), axis=1)
    return len(loop) >= _FEWEST and float(np.ptp(far)) <= _ONE_LINE_M


@lru_cache(maxsize=1)
def list_quarter_turns() -> Array:
    """The rotations that carry the axes of a frame onto each other, (24, 3, 3), the identity first."""
    ways = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    signed = [np.eye(3)[list(order)] * np.array(signs)[:, None] + 0.0 for order, signs in ways]
    return copy_frozen([R for R in signed if np.linalg.det(R) > 0.0])


@lru_cache(maxsize=256)
def find_symmetries(solid: Solid) -> Array:
    """The displacements g of a solid that leave the space it fills as it is, (m, 4, 4), the identity first.

    Fit faces lie on fit faces then, too: a part that recedes on one side only does not look the same from both.
    A union of axis-aligned boxes has faces towards both ends of all three axes and no others, so a turn that leaves it
    as it is carries axes onto axes: the 24 quarter turns about the centre of volume are all that can. Names of faces
    do not count. Observed at `T g` it looks as it does at `T`.

    A solid of other pieces or with round faces is turned by where its faces can go (`exact_turns`). Of a part of
    revolution, which has any number of them, those are here that turn its axis: none but the identity, or one more.
    """
    if solid.rounds or not all_boxes(solid.pieces):
        about = find_revolution(solid)
        return copy_frozen(exact_turns(solid) if about is None else [np.eye(4), *[_over(about)] * about.reversible])
    c = solid.centroid
    centred = [(box.center - c, box.half) for box in solid.pieces]
    kept = [R for R in list_quarter_turns() if _same(centred, [(R @ at, np.abs(R) @ half) for at, half in centred])]
    return copy_frozen([g for g in (centred_turn(solid, R) for R in kept) if _keeps_fit(solid, g)])


def _over(about: Revolution) -> Array:
    """The turn, (4, 4), that puts a part of revolution upside down."""
    return make_turn(about.point, find_direction_across(about.axis), np.pi)


def find_nearest_alike(solid: Solid, T: Array, expected: Array) -> Array:
    """The pose, (4, 4), at which a solid looks as it does at T, turned least away from an expected pose (4, 4).

    Of several expected poses, (*, 4, 4), each has a pose. Any turn about an axis of revolution looks the same.
    """
    if find_revolution(solid) is not None:
        return find_least_turned(solid, T, expected)
    off = (pose.inverse(expected) @ T).reshape(-1, 4, 4)
    return np.asarray(T @ nearest_symmetry(find_symmetries(solid), off).reshape(np.shape(expected)))


def count_folds(symmetric: Array) -> Array:
    """How often a part looks the same in a whole turn about each axis of its frame, (3,): 1, 2 or 4.

    Args:
        symmetric: (m, 4, 4), from `find_symmetries`.
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


def find_nearest_symmetric_pose(T: Array, symmetric: Array, expected: Array) -> Array:
    """The pose T g, (4, 4), that looks like T and is turned least away from an expected rotation (3, 3)."""
    poses = T @ symmetric
    return np.asarray(poses[np.einsum("nij,ij->n", poses[:, :3, :3], expected).argmax()])


def _same(a: list[tuple[Array, Array]], b: list[tuple[Array, Array]]) -> bool:
    """Whether two unions of boxes, each a centre and half sizes, fill the same space: cell by cell of their grid."""
    cuts = [_cuts(np.array([at[i] + s * half[i] for at, half in a + b for s in (-1.0, 1.0)])) for i in range(3)]
    middles = [(cut[1:] + cut[:-1]) / 2 for cut in cuts]
    return bool(np.array_equal(_fill(a, middles), _fill(b, middles)))


def _keeps_fit(solid: Solid, g: Array) -> bool:
    """Whether a displacement that leaves the space as it is carries every fit face onto a fit face."""
    fit = [face for face in solid.faces.values() if face.fit]
    return all(any(_same_corners(pose.apply(g, face.outline), other.outline) for other in fit) for face in fit)


def _same_corners(a: Array, b: Array) -> bool:
    """Whether two outlines, (n, 3) and (m, 3), have the same corners, wherever they begin."""
    far = np.linalg.norm(a[:, None] - b[None], axis=-1)
    return bool(len(a) == len(b) and (far.min(axis=0) < _SAME_M).all() and (far.min(axis=1) < _SAME_M).all())


def _cuts(values: Array) -> Array:
    """Sorted, with one of those that are the same."""
    ordered = np.sort(values)
    return ordered[np.append(True, np.diff(ordered) > _SAME_M)]


def _fill(boxes: list[tuple[Array, Array]], middles: list[Array]) -> NDArray[np.bool_]:
    """Which cells, given by their middles along each axis, are in one of the boxes."""
    filled = np.zeros([len(m) for m in middles], dtype=np.bool_)
    for at, half in boxes:
        inside = [np.abs(m - at[i]) < half[i] for i, m in enumerate(middles)]
        filled |= inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]
    return filled
