"""Approximate symmetries: quarter and half turns after which a part nearly looks the same to a pose estimator."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, remember
from apo_bench.geometry.polygon import find_direction_across
from apo_bench.geometry.solid import Piece, Solid
from apo_bench.geometry.symmetry import find_revolution, find_symmetries, make_rotation_about_axis
from apo_bench.geometry.symmetry_search import measure_depth_inside

LEAST_SHARE = 0.7
"""Least share of its own volume that a turned part covers to be confused with the part as it is."""
_POINTS = 500
"""Approximate number of sample points that stand for the volume of a part."""
_R3_ROOT = 1.2207440846057596
"""The real root of g^4 = g + 1, which generates the sequence R3."""
_PRINCIPAL = 1e-2
"""Products of inertia below this fraction of the trace: the axes of the frame count as principal axes."""
_EQUAL = 1e-6
"""Tolerance of equal displacements, [m] and entries of rotations, and of points on the surface of a piece, [m]."""
_ANGLES_RAD = (np.pi / 2, np.pi, -np.pi / 2)
"""The tested angles about each axis, [rad]."""


class Flips(NamedTuple):
    """The m displacements F of a part after which it nearly looks the same: at `T F` nearly as at `T`."""

    turns: Array
    """(m, 4, 4), rotations by 90 or 180 degrees about axes through the centre of volume, [m]; never the identity."""
    shares: Array
    """(m,), the share of its own volume that the turned part covers, 0 to 1."""
    exact: NDArray[np.bool_]
    """(m,), whether the rotation is an exact symmetry (`find_symmetries`): it cannot be observed, but contacts name
    other faces."""


@remember
def find_approximate_symmetries(solid: Solid) -> Flips:
    """The rotations by 90 and 180 degrees after which a solid covers at least `LEAST_SHARE` of its own volume.

    The axes go through the centre of volume, along the axes of the frame, or along the principal axes where these
    differ. The share is measured at about 500 points, so within about 0.04. Exact symmetries are kept and marked. Of a
    part of revolution only one half turn that swaps its ends is tried: no contact depends on turns about its axis.
    """
    points, weights = _sample_points(solid)
    revolution = find_revolution(solid)
    if revolution is None:
        axes = _rotation_axes(solid)
        turns = np.array(
            [make_rotation_about_axis(solid.centroid, axis, angle) for axis in axes for angle in _ANGLES_RAD]
        )
    else:
        turns = make_rotation_about_axis(revolution.point, find_direction_across(revolution.axis), np.pi)[None]
    exact = np.abs(turns[:, None] - find_symmetries(solid)).max(axis=(2, 3)).min(axis=1) < _EQUAL
    shares = np.ones(len(turns))
    turned_points = np.concatenate([np.zeros((0, 3)), *(pose.apply(flip, points) for flip in turns[~exact])])
    # Share = volume of the points that lie in the part after the turn, over that of all points; exact turns have 1.
    covered = np.any([_find_inside(piece, turned_points) for piece in solid.pieces], axis=0)
    shares[~exact] = covered.reshape(-1, len(points)) @ weights / weights.sum()
    kept = shares >= LEAST_SHARE
    flips = Flips(turns[kept], shares[kept], exact[kept])
    for array in flips:
        array.flags.writeable = False
    return flips


def _sample_points(solid: Solid) -> tuple[Array, Array]:
    """Sample points inside a solid, (k, 3), [m], and the volume that each stands for, (k,).

    They are even in the box of every piece: the sequence R3 of M. Roberts, "The unreasonable effectiveness of
    quasirandom sequences", 2018.
    """
    pieces = solid.pieces
    piece_of_point = np.repeat(np.arange(len(pieces)), max(2, _POINTS // len(pieces)))
    # Point i of the sequence is (1/2 + i (1/g, 1/g^2, 1/g^3)) mod 1: even along every axis, unlike a grid, which a
    # quarter turn carries onto itself.
    steps = _R3_ROOT ** -np.arange(1.0, 4.0)
    fractions = (0.5 + np.arange(len(piece_of_point))[:, None] * steps) % 1.0
    half_sizes = np.array([piece.half for piece in pieces])[piece_of_point]
    points = np.array([piece.center for piece in pieces])[piece_of_point] + (2.0 * fractions - 1.0) * half_sizes
    volumes = half_sizes.prod(axis=1)
    inside = np.array([_find_inside(piece, points) for piece in pieces])
    in_own_piece = inside[
        piece_of_point, np.arange(len(piece_of_point))
    ]  # the point lies in its own piece, not just in the box around that
    # A point of a piece that lies in c pieces at once is drawn in each of them, so it counts 1 / c.
    return points[in_own_piece], volumes[in_own_piece] / inside.sum(axis=0)[in_own_piece]


def _rotation_axes(solid: Solid) -> Array:
    """The axes of the tested turns as rows, (3, 3): those of the frame if they are principal, else the principal
    axes.
    """
    inertia = solid.inertia
    if inertia is None or np.abs(inertia - np.diag(np.diag(inertia))).max() < _PRINCIPAL * np.trace(inertia):
        return np.eye(3)
    return np.asarray(np.linalg.eigh(inertia)[1].T)


def _find_inside(piece: Piece, points: Array) -> NDArray[np.bool_]:
    """Which points, (k, 3), lie in a piece, (k,); only those in its box are compared with its planes, to save time."""
    near = np.flatnonzero((np.abs(points - piece.center) <= piece.half + _EQUAL).all(axis=1))
    inside = np.zeros(len(points), dtype=np.bool_)
    inside[near] = measure_depth_inside(piece, points[near]) >= -_EQUAL
    return inside
