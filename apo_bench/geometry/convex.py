"""Convex pieces: their shadows, what is around several of them, and along which directions two of them may be apart."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array, copy_frozen
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.solid import Piece

_ALONG = 1e-12
"""Cosine between a ray and the normal of a plane that it goes along."""
_PARALLEL = 1e-6
"""Edges whose cross product is shorter give no direction of their own."""


def project_on_axes(piece: Piece, R: Array, axes: Array) -> tuple[Array, Array]:
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


def find_separating_axes(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """The directions, (k, 3), along which two pieces may be apart: across sides, and across an edge of each."""
    return np.concatenate([across_sides(a, R_a, b, R_b), across_edges(a, R_a, b, R_b)])


def across_sides(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """Those that are normals of a side, (k, 3)."""
    return np.concatenate([a.normals @ R_a.T, b.normals @ R_b.T])


def across_edges(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """Those across an edge of each, (k, 3)."""
    return _cross(a.edges @ R_a.T, b.edges @ R_b.T)


def box_axes(R_a: Array, R_b: Array) -> Array:
    """The directions along which two boxes may be apart, (k, 3), by their orientations, (3, 3)."""
    return np.concatenate([R_a.T, R_b.T, _cross(R_a.T, R_b.T)])


def _cross(edges_a: Array, edges_b: Array) -> Array:
    """The cross product of each of some directions, (a, 3), with each of others, (b, 3), unit length; parallel ones
    give none."""
    u = edges_a[:, None]
    v = edges_b[None]
    pairs = np.empty((len(u), v.shape[1], 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        pairs[..., i] = u[..., j] * v[..., k] - u[..., k] * v[..., j]
    crossed = pairs.reshape(-1, 3)
    length = np.sqrt((crossed * crossed).sum(axis=1))
    kept = length > _PARALLEL
    return np.asarray(crossed[kept] / length[kept, None])


def measure_passage(planes: Array, start: Array, way: Array) -> tuple[Array, Array]:
    """How far rays go until they enter a convex piece, and until they leave it, (*,) each; inf and -inf if they miss.

    Args:
        planes: (s, 4), n . x <= d inside, [m].
        start, way: (*, 3), where each ray begins and its unit vector; one of them may be the same for all, (3,).
    """
    # n . (s + t w) = d at t = (d - n . s) / (n . w): entered by planes against the way, left by planes along it; on
    # which side of a plane a ray along it is, it says where it begins.
    rate = way @ planes[:, :3].T
    room = planes[:, 3] - start @ planes[:, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / rate
    enter = np.where(rate < -_ALONG, at, -np.inf).max(axis=-1)
    leave = np.where(rate > _ALONG, at, np.inf).min(axis=-1)
    missed = ((np.abs(rate) <= _ALONG) & (room < 0.0)).any(axis=-1) | (enter >= leave)
    return np.where(missed, np.inf, enter), np.where(missed, -np.inf, leave)


@lru_cache(maxsize=1024)
def collect_corners(pieces: tuple[Piece, ...]) -> tuple[Array, NDArray[np.intp]]:
    """The corners of all pieces, (k, 3), in the frame of their solid, [m], and where those of each begin."""
    corners = [piece.corners for piece in pieces]
    return copy_frozen(np.concatenate(corners), None, 3), np.cumsum([0, *map(len, corners[:-1])])


@lru_cache(maxsize=1024)
def boxes_around(pieces: tuple[Piece, ...]) -> tuple[Array, Array]:
    """Centres and half sizes, (k, 3) each, of boxes or of those around pieces, in the frame of their solid, [m]."""
    return copy_frozen([piece.center for piece in pieces], None, 3), copy_frozen(
        [piece.half for piece in pieces], None, 3
    )


def boxes_reach(a: tuple[Piece, ...], R_a: Array, b: tuple[Piece, ...], R_b: Array, axes: Array) -> Array:
    """Half lengths of the shadows on axes, (k, 3), of each box of a solid and each of another together, (a, b, k)."""
    # The shadow of a box of half sizes h on a unit vector u of its frame is |u| . h long to each side.
    halves = [boxes_around(of)[1] @ np.abs(axes @ R).T for of, R in ((a, R_a), (b, R_b))]
    return np.asarray(halves[0][:, None] + halves[1][None])


@lru_cache(maxsize=4096)
def enclose_in_ball(pieces: tuple[Piece, ...]) -> tuple[Array, float]:
    """Middle, (3,), of the box around all pieces, in the frame of their solid, and half its diagonal, [m]."""
    centers, halves = boxes_around(pieces)
    low = (centers - halves).min(axis=0)
    high = (centers + halves).max(axis=0)
    return copy_frozen((low + high) / 2, 3), float(np.linalg.norm(high - low)) / 2


def measure_ball_distance(a: tuple[Piece, ...], T_a: Array, b: tuple[Piece, ...], T_b: Array) -> float:
    """How far the balls around all pieces of two posed solids are apart, [m]; negative where they overlap."""
    middle_a, radius_a = enclose_in_ball(a)
    middle_b, radius_b = enclose_in_ball(b)
    between = T_a[:3, :3] @ middle_a + T_a[:3, 3] - T_b[:3, :3] @ middle_b - T_b[:3, 3]
    return float(np.sqrt(between @ between)) - radius_a - radius_b
