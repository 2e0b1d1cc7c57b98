"""Exact symmetries of a part: rotations after which it looks the same, and the nearest pose that looks like another.

Most parts have a few; a part of revolution may be turned about its axis by any angle.
"""

from functools import lru_cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, copy_frozen
from apo_bench.geometry.polygon import find_direction_across
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Solid, all_boxes
from apo_bench.geometry.symmetry_search import (
    covers_same_volume,
    find_exact_symmetries,
    is_symmetry,
    make_rotation_about_centroid,
)

_SAME_M = 1e-6
"""Coordinates of corners closer than this are equal, [m]."""
_COLLINEAR_M = 1e-5
"""Lines closer than this are the same axis, [m]; distances from an axis that differ by less are equal."""
_PARALLEL = 1e-10
"""Two unit vectors are parallel if the absolute value of their cosine is above 1 minus this."""
_FEWEST_CORNERS = 8
"""Least number of sides of a polygon that may stand for a circle: walls without contacts are as coarse as this."""
_POLYGON_ERROR = 1.0 / np.cos(np.pi / _FEWEST_CORNERS) - 1.0
"""Difference between the outer and the inner radius of such a polygon, as a fraction of the radius."""
_TEST_ANGLES_RAD = (0.41, 1.37, 2.71)
"""Test angles that map no regular polygon of few sides onto itself, [rad]."""
_INERTIA_TOLERANCE = 1e-3
"""Tolerance when moments of inertia are compared, as a fraction of their sum."""


class Revolution(NamedTuple):
    """The axis of revolution of a part, in the frame of the part."""

    point: Array
    """The centre of volume, a point of the axis, (3,), [m]."""
    axis: Array
    """Unit vector, (3,)."""
    reversible: bool
    """Whether the part looks the same after a half turn that swaps the two ends of the axis."""


@lru_cache(maxsize=256)
def find_revolution(solid: Solid) -> Revolution | None:
    """The axis about which a part may be turned by any angle; None if there is none.

    All round faces must be whole turns about this axis. Flat faces must be perpendicular to it and bounded by circles
    about it. The pieces must fill the same space after a turn, and the inertia, if stated, must stay the same. Round
    walls of pieces are polygons, so the filled space is checked only to 8 % of the largest radius.
    """
    rounds = list(solid.rounds.values())
    if not rounds or not all(_is_whole_turn_about(wall, solid.centroid, rounds[0].axis) for wall in rounds):
        return None
    revolution = Revolution(solid.centroid, rounds[0].axis, reversible=False)
    for face in solid.faces.values():
        is_perpendicular = abs(face.normal @ revolution.axis) > 1.0 - _PARALLEL
        if not is_perpendicular or not all(_is_circle(revolution, ring) for ring in (face.outline, *face.holes)):
            return None
    turns = [make_rotation_about_axis(revolution.point, revolution.axis, angle) for angle in _TEST_ANGLES_RAD]
    inertia = solid.inertia
    R = turns[0][:3, :3]
    if inertia is not None and np.abs(R @ inertia @ R.T - inertia).max() > _INERTIA_TOLERANCE * np.trace(inertia):
        return None
    tolerance_m = _POLYGON_ERROR * max(max(wall.radii) for wall in rounds)
    if not all(covers_same_volume(solid, g, tolerance_m) for g in turns):
        return None
    return revolution._replace(reversible=is_symmetry(solid, _half_turn_of_ends(revolution)))


def make_rotation_about_axis(point: Array, axis: Array, angle_rad: float) -> Array:
    """The rotation about an axis through a point as a displacement, (4, 4).

    Args:
        point: A point of the axis, (3,), [m].
        axis: Unit vector, (3,).
    """
    spin = np.concatenate([np.zeros(3), axis * angle_rad])
    return np.asarray(pose.at(point) @ pose.exp(spin) @ pose.at(-point))


def find_least_rotated_pose(solid: Solid, T: Array, true: Array) -> Array:
    """The pose among those that look like T, of a part of revolution, that is rotated least relative to another pose.

    A part without an axis of revolution keeps T. The centre of volume does not move.

    Args:
        T: The observed pose, (4, 4), [m].
        true: Rotation or pose to compare with, (3, 3) or (4, 4); or several of them, (*, 3, 3) or (*, 4, 4).

    Returns:
        (4, 4), or (*, 4, 4) for several; T itself, (4, 4), if the part has no axis of revolution.
    """
    revolution = find_revolution(solid)
    if revolution is None:
        return T
    # M is the rotation from the other pose to T. Of all turns about the axis, with and without swapped ends, the one
    # for which M times it has the greatest trace leaves the least angle. The centre of volume stays where it is.
    offset = np.swapaxes(true[..., :3, :3], -1, -2) @ T[:3, :3]
    axis = revolution.axis
    perpendicular = find_direction_across(axis)
    flips = np.array([np.eye(3), 2.0 * np.outer(perpendicular, perpendicular) - np.eye(3)][: 1 + revolution.reversible])
    candidates = flips @ _least_rotation_about_axis(offset[..., None, :, :] @ flips, axis)
    traces = np.einsum("...ij,...fji->...f", offset, candidates)
    best = np.take_along_axis(candidates, traces.argmax(axis=-1)[..., None, None, None], axis=-3)[..., 0, :, :]
    return pose.rigid(T[:3, :3] @ best, T[:3, 3] + (revolution.point - best @ revolution.point) @ T[:3, :3].T)


def _least_rotation_about_axis(offset: Array, axis: Array) -> Array:
    """The rotation R about an axis, (*, 3, 3), for which M R has the least angle, that is, the greatest trace.

    Args:
        offset: Rotations, (*, 3, 3).
    """
    # trace(M R(t)) = c + (trace(M) - a . M a) cos t + trace(M K) sin t, which is greatest at this t.
    K = pose.hat(axis)
    angle = np.arctan2((offset * K.T).sum(axis=(-2, -1)), np.trace(offset, axis1=-2, axis2=-1) - (offset @ axis) @ axis)
    return np.eye(3) + np.sin(angle)[..., None, None] * K + (1.0 - np.cos(angle))[..., None, None] * (K @ K)


def _is_whole_turn_about(face: RoundFace, point: Array, axis: Array) -> bool:
    """Whether a round face is a whole turn about the axis through a point."""
    distance = np.cross(face.point - point, axis)
    return bool(
        face.toward is None and abs(face.axis @ axis) > 1.0 - _PARALLEL and np.sqrt(distance @ distance) < _COLLINEAR_M
    )


def _is_circle(revolution: Revolution, ring: Array) -> bool:
    """Whether corners, (k, 3), lie on a circle about the axis, and are at least `_FEWEST_CORNERS`."""
    distances = np.linalg.norm(np.cross(ring - revolution.point, revolution.axis), axis=1)
    return len(ring) >= _FEWEST_CORNERS and float(np.ptp(distances)) <= _COLLINEAR_M


@lru_cache(maxsize=1)
def list_quarter_turns() -> Array:
    """The 24 rotations that map the axes of a frame onto each other, (24, 3, 3), the identity first."""
    signed_orders = product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    matrices = [np.eye(3)[list(order)] * np.array(signs)[:, None] + 0.0 for order, signs in signed_orders]
    return copy_frozen([R for R in matrices if np.linalg.det(R) > 0.0])


@lru_cache(maxsize=256)
def find_symmetries(solid: Solid) -> Array:
    """The displacements g, in the frame of a solid, after which it fills the same space, (m, 4, 4), the identity first.

    Observed at `T g` the solid looks as it does at `T`. Fit faces must map onto fit faces too, since a part that
    recedes on one side only does not look the same from both. Names of faces do not count.

    For a union of axis-aligned boxes only the 24 quarter turns about the centre of volume can be symmetries: its faces
    point along both senses of all three axes and nowhere else. For other solids see `find_exact_symmetries`. A part of
    revolution has infinitely many; here they are the identity and, if its ends can be swapped, one half turn that swaps
    them.
    """
    if solid.rounds or not all_boxes(solid.pieces):
        revolution = find_revolution(solid)
        return copy_frozen(
            find_exact_symmetries(solid)
            if revolution is None
            else [np.eye(4), *[_half_turn_of_ends(revolution)] * revolution.reversible]
        )
    centroid = solid.centroid
    centred = [(box.center - centroid, box.half) for box in solid.pieces]
    kept = [
        R
        for R in list_quarter_turns()
        if _fill_same_space(centred, [(R @ position, np.abs(R) @ half) for position, half in centred])
    ]
    return copy_frozen([g for g in (make_rotation_about_centroid(solid, R) for R in kept) if _maps_fit_faces(solid, g)])


def _half_turn_of_ends(revolution: Revolution) -> Array:
    """The half turn, (4, 4), that swaps the ends of a part of revolution."""
    return make_rotation_about_axis(revolution.point, find_direction_across(revolution.axis), np.pi)


def find_nearest_equivalent_pose(solid: Solid, T: Array, expected: Array) -> Array:
    """The pose among those at which a solid looks as it does at T that is rotated least relative to an expected pose.

    Args:
        T: The observed pose, (4, 4), [m].
        expected: One pose, (4, 4), or several, (*, 4, 4); each gets its own nearest pose.

    Returns:
        (4, 4) or (*, 4, 4); any angle about an axis of revolution looks the same.
    """
    if find_revolution(solid) is not None:
        return find_least_rotated_pose(solid, T, expected)
    offsets = (pose.inverse(expected) @ T).reshape(-1, 4, 4)
    return np.asarray(T @ nearest_symmetry(find_symmetries(solid), offsets).reshape(np.shape(expected)))


def count_folds(symmetric: Array) -> Array:
    """How many times a part looks the same during a whole turn about each axis of its frame, (3,): 1, 2 or 4.

    Args:
        symmetric: (m, 4, 4), from `find_symmetries`.
    """
    # A rotation about axis i leaves entry (i, i) at exactly 1; symmetric[0] is the identity, which counts as 1.
    return np.array([1.0 + sum(R[i, i] == 1.0 for R in symmetric[1:, :3, :3]) for i in range(3)])


def nearest_symmetry(symmetric: Array, offsets: Array) -> Array:
    """For each displacement, (n, 4, 4), the symmetry g, (n, 4, 4), for which `off @ g` has the smallest rotation angle.

    Ties go to the first symmetry, which is the identity if it is among them.
    """
    # trace(R) = 1 + 2 cos(angle): the smallest angle has the greatest trace.
    traces = np.einsum("nij,mji->nm", offsets[:, :3, :3], symmetric[:, :3, :3])
    close = traces >= traces.max(axis=1, keepdims=True) - 1e-12
    return np.asarray(symmetric[np.argmax(close, axis=1)])


def find_nearest_symmetric_pose(T: Array, symmetric: Array, expected: Array) -> Array:
    """The pose T g, (4, 4), that is rotated least relative to an expected rotation, (3, 3).

    Args:
        T: The observed pose, (4, 4), [m].
        symmetric: The symmetries g, (m, 4, 4), from `find_symmetries`.
    """
    poses = T @ symmetric
    return np.asarray(poses[np.einsum("nij,ij->n", poses[:, :3, :3], expected).argmax()])


def _fill_same_space(a: list[tuple[Array, Array]], b: list[tuple[Array, Array]]) -> bool:
    """Whether two unions of boxes fill the same space, compared cell by cell on the grid of all their faces.

    Args:
        a, b: Centre and half sizes of each box, (3,) each, [m].
    """
    grid = [
        _distinct_values(np.array([center[i] + sign * half[i] for center, half in a + b for sign in (-1.0, 1.0)]))
        for i in range(3)
    ]
    middles = [(planes[1:] + planes[:-1]) / 2 for planes in grid]
    return bool(np.array_equal(_mark_filled_cells(a, middles), _mark_filled_cells(b, middles)))


def _maps_fit_faces(solid: Solid, g: Array) -> bool:
    """Whether a symmetry g of the filled space, (4, 4), maps every fit face onto a fit face."""
    fit = [face for face in solid.faces.values() if face.fit]
    return all(any(_have_same_corners(pose.apply(g, face.outline), other.outline) for other in fit) for face in fit)


def _have_same_corners(a: Array, b: Array) -> bool:
    """Whether two outlines, (n, 3) and (m, 3), have the same corners, at whichever corner they begin."""
    distances = np.linalg.norm(a[:, None] - b[None], axis=-1)
    return bool(
        len(a) == len(b) and (distances.min(axis=0) < _SAME_M).all() and (distances.min(axis=1) < _SAME_M).all()
    )


def _distinct_values(values: Array) -> Array:
    """Sorted values without duplicates up to `_SAME_M`."""
    ascending = np.sort(values)
    return ascending[np.append(True, np.diff(ascending) > _SAME_M)]


def _mark_filled_cells(boxes: list[tuple[Array, Array]], middles: list[Array]) -> NDArray[np.bool_]:
    """Which cells of a grid lie in one of the boxes, (x, y, z) booleans.

    Args:
        boxes: Centre and half sizes of each, (3,), [m].
        middles: Centres of the cells along each of the three axes.
    """
    filled = np.zeros([len(coordinates) for coordinates in middles], dtype=np.bool_)
    for center, half in boxes:
        inside = [np.abs(coordinates - center[i]) < half[i] for i, coordinates in enumerate(middles)]
        filled |= inside[0][:, None, None] & inside[1][None, :, None] & inside[2][None, None, :]
    return filled
