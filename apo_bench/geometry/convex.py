"""Building blocks of separating-axis tests of convex pieces: projections, candidate axes, rays and bounding volumes."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array, copy_frozen
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.solid import Piece

_PARALLEL_RAY = 1e-12
"""Cosine between a ray and the normal of a plane, up to which the ray counts as parallel to the plane."""
_PARALLEL_EDGES = 1e-6
"""Length of the cross product of two unit edges, up to which they count as parallel and give no axis."""


def project_on_axes(piece: Piece, R: Array, axes: Array) -> tuple[Array, Array]:
    """Project a piece, with its frame at the origin, on k axes: middle and half length of each interval, (k,), [m].

    Args:
        R: (3, 3), the orientation of the piece, world.
        axes: (k, 3), unit vectors, world.
    """
    local_axes = axes @ R
    if isinstance(piece, Hull):
        projections = local_axes @ piece.corners.T
        low = projections.min(axis=1)
        high = projections.max(axis=1)
        return (low + high) / 2, (high - low) / 2
    return local_axes @ piece.center, np.abs(local_axes) @ piece.half


def find_separating_axes(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """All axes that can separate two convex pieces, (k, 3), world: normals of sides, cross products of two edges."""
    return np.concatenate([list_side_axes(a, R_a, b, R_b), list_edge_axes(a, R_a, b, R_b)])


def list_side_axes(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """The separating axes that are normals of a side of one of two pieces, (k, 3), world."""
    return np.concatenate([a.normals @ R_a.T, b.normals @ R_b.T])


def list_edge_axes(a: Piece, R_a: Array, b: Piece, R_b: Array) -> Array:
    """The separating axes that are cross products of an edge of each of two pieces, (k, 3), world, unit length."""
    return _unit_cross_products(a.edges @ R_a.T, b.edges @ R_b.T)


def list_box_axes(R_a: Array, R_b: Array) -> Array:
    """All axes that can separate two boxes, (k, 3), world, from their orientations R_a and R_b, (3, 3)."""
    return _box_axes_of_numbers(R_a.tobytes(), R_b.tobytes())


@lru_cache(maxsize=1024)
def _box_axes_of_numbers(a: bytes, b: bytes) -> Array:
    """`list_box_axes` of the numbers of two matrices; cached, since many boxes have the same orientations."""
    R_a, R_b = (np.frombuffer(numbers).reshape(3, 3) for numbers in (a, b))
    return copy_frozen(np.concatenate([R_a.T, R_b.T, _unit_cross_products(R_a.T, R_b.T)]), None, 3)


def _unit_cross_products(edges_a: Array, edges_b: Array) -> Array:
    """Unit cross products of every pair of directions, (a, 3) and (b, 3); pairs that are parallel are left out."""
    u = edges_a[:, None]
    v = edges_b[None]
    products_by_pair = np.empty((len(u), v.shape[1], 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        products_by_pair[..., i] = u[..., j] * v[..., k] - u[..., k] * v[..., j]
    products = products_by_pair.reshape(-1, 3)
    length = np.sqrt((products * products).sum(axis=1))
    kept = length > _PARALLEL_EDGES
    return np.asarray(products[kept] / length[kept, None])


def intersect_rays(planes: Array, start: Array, direction: Array) -> tuple[Array, Array]:
    """Distances after which rays enter and leave a convex piece, (*,) each, [m]; inf and -inf for rays that miss it.

    Args:
        planes: (s, 4), n . x <= d inside, [m].
        start, direction: (*, 3), where each ray begins and its unit vector; one of them may be the same for all, (3,).
    """
    # n . (s + t w) = d at t = (d - n . s) / (n . w): a ray enters through planes with n . w < 0 and leaves through
    # those with n . w > 0. A ray parallel to a plane stays on the side of it on which it begins.
    rate = direction @ planes[:, :3].T
    offset = planes[:, 3] - start @ planes[:, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = offset / rate
    enter = np.where(rate < -_PARALLEL_RAY, distance, -np.inf).max(axis=-1)
    leave = np.where(rate > _PARALLEL_RAY, distance, np.inf).min(axis=-1)
    missed = ((np.abs(rate) <= _PARALLEL_RAY) & (offset < 0.0)).any(axis=-1) | (enter >= leave)
    return np.where(missed, np.inf, enter), np.where(missed, -np.inf, leave)


@lru_cache(maxsize=1024)
def collect_corners(pieces: tuple[Piece, ...]) -> tuple[Array, NDArray[np.intp]]:
    """The corners of all pieces, piece by piece, (k, 3), frame of the solid, [m], and the first index of each piece."""
    corners = [piece.corners for piece in pieces]
    return copy_frozen(np.concatenate(corners), None, 3), np.cumsum([0, *map(len, corners[:-1])])


@lru_cache(maxsize=1024)
def list_bounding_boxes(pieces: tuple[Piece, ...]) -> tuple[Array, Array]:
    """Centres and half sizes, (k, 3) each, of the axis-aligned box around each piece, frame of the solid, [m]."""
    return copy_frozen([piece.center for piece in pieces], None, 3), copy_frozen(
        [piece.half for piece in pieces], None, 3
    )


def compute_half_projection_sums(
    a: tuple[Piece, ...], R_a: Array, b: tuple[Piece, ...], R_b: Array, axes: Array
) -> Array:
    """Sum of the half lengths of the projections of each box of a and each box of b on each of k axes, (a, b, k), [m].

    Args:
        R_a, R_b: Orientations of the solids, (3, 3), world.
        axes: (k, 3), unit vectors, world.
    """
    # The projection of a box of half sizes h on a unit vector u of its frame has half length |u| . h.
    halves = [list_bounding_boxes(of)[1] @ np.abs(axes @ R).T for of, R in ((a, R_a), (b, R_b))]
    return np.asarray(halves[0][:, None] + halves[1][None])


@lru_cache(maxsize=4096)
def enclose_in_ball(pieces: tuple[Piece, ...]) -> tuple[Array, float]:
    """Centre, (3,), and radius, [m], of a ball around all pieces, frame of the solid; it encloses their common box."""
    centers, halves = list_bounding_boxes(pieces)
    low = (centers - halves).min(axis=0)
    high = (centers + halves).max(axis=0)
    return copy_frozen((low + high) / 2, 3), float(np.linalg.norm(high - low)) / 2


def measure_ball_distance(a: tuple[Piece, ...], T_a: Array, b: tuple[Piece, ...], T_b: Array) -> float:
    """The distance of the balls around two posed solids, [m]; negative where they overlap."""
    middle_a, radius_a = enclose_in_ball(a)
    middle_b, radius_b = enclose_in_ball(b)
    offset = T_a[:3, :3] @ middle_a + T_a[:3, 3] - T_b[:3, :3] @ middle_b - T_b[:3, 3]
    return float(np.sqrt(offset @ offset)) - radius_a - radius_b
