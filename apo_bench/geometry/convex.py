"""Shadows of convex pieces, and the directions along which two of them may be apart."""

from collections.abc import Iterable

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.solid import Box, Piece

_PARALLEL = 1e-6
"""Edges whose cross product is shorter give no direction of their own."""


def all_boxes(pieces: Iterable[Piece]) -> bool:
    """Whether there is nothing but boxes."""
    return all(isinstance(piece, Box) for piece in pieces)


def shadow(piece: Piece, R: Array, axes: Array) -> tuple[Array, Array]:
    """The middles and half lengths, (k,) each, of the shadow of a piece on axes of the world, its frame at the origin.

    Args:
        R: (3, 3), the orientation of the piece.
        axes: (k, 3), unit vectors.
    """
    own = axes @ R
    if isinstance(piece, Hull):
        ends = own @ piece.corners.T
        low = ends.min(axis=1)
        high = ends.max(axis=1)
        return (low + high) / 2, (high - low) / 2
    return own @ piece.center, np.abs(own) @ piece.half


def separating_axes(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """The directions, (k, 3), along which two pieces may be apart: across sides, and across an edge of each."""
    return np.concatenate([across_sides(a, R_a, b, R_b), across_edges(a, R_a, b, R_b)])


def across_sides(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """Those that are normals of a side, (k, 3)."""
    return np.concatenate([_sides(a)[0] @ R_a.T, _sides(b)[0] @ R_b.T])


def across_edges(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """Those across an edge of each, (k, 3)."""
    u = (_sides(a)[1] @ R_a.T)[:, None]
    v = (_sides(b)[1] @ R_b.T)[None]
    pairs = np.empty((len(u), v.shape[1], 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        pairs[..., i] = u[..., j] * v[..., k] - u[..., k] * v[..., j]
    crossed = pairs.reshape(-1, 3)
    length = np.sqrt((crossed * crossed).sum(axis=1))
    kept = length > _PARALLEL
    return np.asarray(crossed[kept] / length[kept, None])


def piece_corners(piece: Piece) -> Array:
    """The corners of a piece, (k, 3), in the frame of its solid, [m]."""
    return piece.corners if isinstance(piece, Hull) else np.asarray(piece.center + _SIGNS * piece.half)


_SIGNS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T


def _sides(piece: Piece) -> tuple[Array, Array]:
    """Directions across the sides of a piece, and along its edges."""
    return (piece.normals, piece.edges) if isinstance(piece, Hull) else (np.eye(3), np.eye(3))
