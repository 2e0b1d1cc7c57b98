"""Penetration depth of two solids of convex pieces by separating axes, and the drop height of one onto the other.

The depth of two convex pieces is the least overlap of their projections over all separating axes. The depth of two
solids is that of their deepest pair of pieces. Bounds from balls and axis-aligned boxes ("rooms") rule out most pairs.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, copy_frozen
from apo_bench.geometry.convex import (
    collect_corners,
    compute_half_projection_sums,
    find_separating_axes,
    list_bounding_boxes,
    list_box_axes,
    list_edge_axes,
    list_side_axes,
    measure_ball_distance,
    project_on_axes,
)
from apo_bench.geometry.solid import Piece, Solid, all_boxes

_TOUCHING_M = 1e-6
"""Solids whose enclosing balls are farther apart than this are apart; it absorbs rounding, [m]."""
TOUCH_M = 1e-6
"""Depth above which a solid counts as inside another one; up to it they touch, [m]."""
_STEP_M = 5e-4
"""Coarse spacing of the heights tested along a fall, [m]: two boxes thinner than this together could be missed."""
_MOST_HEIGHTS = 10_000
"""Most heights tested along a fall; a longer fall gets a coarser spacing."""
_BATCH_SIZE = 100_000
"""Pairs of pieces times heights that one batch of a fall computes, which bounds the memory."""
_MOST_BOUNDS = 4_000_000
"""Pairs of pieces times places that one call computes elsewhere, which bounds the memory."""


class Escape(NamedTuple):
    """The directions along which one piece can be moved out of another one, and how far."""

    directions: Array
    """Unit vectors in which the first piece moves out, (k, 3), world."""
    lengths: Array
    """How far it has to move along each, (k,), [m]."""
    at: Array
    """The centre of the smaller piece, (3,), world, [m]."""


def measure_intrusion(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """The depth of the deepest pair of pieces of two posed solids, [m]; 0 if they are apart or only touch.

    Separating axes: two convex pieces are apart if their projections are apart along a normal of a side or along a
    cross product of two edges. The depth is the least overlap of the projections.
    """
    if measure_ball_distance(a.pieces, T_a, b.pieces, T_b) > _TOUCHING_M:
        return 0.0
    return max(0.0, float(measure_intrusion_depths(a.pieces, T_a[:3, :3], T_a[None, :3, 3], b.pieces, T_b, 0.0)[0]))


def measure_intrusion_depths(
    a: tuple[Piece, ...],
    R_a: Array,
    positions: Array,
    b: tuple[Piece, ...],
    T_b: Array,
    apart_m: float = np.inf,
    measured_m: float = 0.0,
) -> Array:
    """How deep pieces `a` are in pieces `b` when `a` is put at each of k places; negative where they are apart.

    Args:
        R_a: (3, 3), the orientation of `a`, the same at all places, world.
        positions: (k, 3), the positions of the frame of `a`, world, [m].
        T_b: (4, 4), world pose of `b`, [m].
        apart_m: The result may be cut off at -apart_m, which saves time.
        measured_m: Pairs whose bounding volumes are farther apart than this may count by the distance of these instead.

    Returns:
        The depth of the deepest pair at each place, (k,), [m].
    """
    if not (all_boxes(a) and all_boxes(b)):
        return _measure_general_pieces(a, R_a, positions, b, T_b, apart_m, measured_m)
    axes = list_box_axes(R_a, T_b[:3, :3])
    # The depth of two boxes is the least overlap of their projections (min over axes); that of two solids is the depth
    # of their deepest pair (max over pairs).
    half_sums = compute_half_projection_sums(a, R_a, b, T_b[:3, :3], axes)
    offsets = (list_bounding_boxes(a)[0] @ R_a.T)[:, None] - (list_bounding_boxes(b)[0] @ T_b[:3, :3].T + T_b[:3, 3])[
        None
    ]
    distances = np.abs((offsets @ axes.T)[None] + (positions @ axes.T)[:, None, None])
    return np.asarray((half_sums[None] - distances).min(axis=-1).max(axis=(1, 2)))


def find_escapes(a: Solid, T_a: Array, b: Solid, T_b: Array, deep_m: float) -> Iterator[Escape]:
    """For each pair of pieces deeper in each other than `deep_m`, the directions and lengths to move the first piece
    out.

    Args:
        T_a, T_b: World poses of the solids, (4, 4), [m].
        deep_m: Pairs that are less deep in each other are left out, [m].
    """
    R_a = T_a[:3, :3]
    R_b = T_b[:3, :3]
    if all_boxes(a.pieces) and all_boxes(b.pieces):
        axes = list_box_axes(R_a, R_b)
        centers_a, centers_b = (
            pose.apply(T, list_bounding_boxes(solid.pieces)[0]) for T, solid in ((T_a, a), (T_b, b))
        )
        along = (centers_a[:, None] - centers_b[None]) @ axes.T
        depths = compute_half_projection_sums(a.pieces, R_a, b.pieces, R_b, axes) - np.abs(along)
        for i, j in np.argwhere(depths.min(axis=-1) > deep_m):
            yield _escape_of_pair(a.pieces[i], T_a, b.pieces[j], T_b, axes, along[i, j], depths[i, j])
        return
    balls_a, radii_a = _list_bounding_balls(a.pieces)
    balls_b, radii_b = _list_bounding_balls(b.pieces)
    offsets = pose.apply(T_a, balls_a)[:, None] - pose.apply(T_b, balls_b)[None]
    near = np.sqrt((offsets * offsets).sum(axis=-1)) < radii_a[:, None] + radii_b
    for own, other in ((a.pieces[i], b.pieces[j]) for i, j in np.argwhere(near)):
        axes = find_separating_axes(own, R_a, other, R_b)
        middle_a, half_a = project_on_axes(own, R_a, axes)
        middle_b, half_b = project_on_axes(other, R_b, axes)
        along = axes @ (T_a[:3, 3] - T_b[:3, 3]) + middle_a - middle_b
        depths = half_a + half_b - np.abs(along)
        if depths.min() > deep_m:
            yield _escape_of_pair(own, T_a, other, T_b, axes, along, depths)


def _escape_of_pair(a: Piece, T_a: Array, b: Piece, T_b: Array, axes: Array, along: Array, depths: Array) -> Escape:
    """The ways out of one pair.

    Args:
        axes: Separating axes, (k, 3), world.
        along: Coordinate of the centre of a relative to that of b on each axis, (k,), [m]; its sign says which way is
            out.
        depths: Overlap of the projections on each axis, (k,), [m].
    """
    piece, T = (a, T_a) if a.half.max() < b.half.max() else (b, T_b)
    return Escape(axes * np.where(along < 0.0, -1.0, 1.0)[:, None], depths, pose.apply(T, piece.center[None])[0])


def _measure_general_pieces(
    a: tuple[Piece, ...],
    R_a: Array,
    positions: Array,
    b: tuple[Piece, ...],
    T_b: Array,
    apart_m: float,
    measured_m: float,
) -> Array:
    """`measure_intrusion_depths` for pieces that are not all boxes.

    Distances of enclosing balls and of upright boxes, and the overlap across sides alone, bound the depth of a pair
    from above. So most pairs need no test of all axes. Many places are split in halves to bound the memory.
    """
    pairs = _find_near_pairs(a, R_a, positions, b, T_b, apart_m)
    if len(positions) < 2 or len(positions) * len(pairs) < _MOST_BOUNDS:
        return _measure_pairs(a, R_a, positions, b, T_b, pairs, apart_m, measured_m)
    halves = (positions[: len(positions) // 2], positions[len(positions) // 2 :])
    return np.concatenate([_measure_general_pieces(a, R_a, each, b, T_b, apart_m, measured_m) for each in halves])


def _measure_pairs(
    a: tuple[Piece, ...],
    R_a: Array,
    positions: Array,
    b: tuple[Piece, ...],
    T_b: Array,
    pairs: Any,
    apart_m: float,
    measured_m: float,
) -> Array:
    """The depth of the deepest of some pairs of pieces at k places, (k,), [m].

    Args:
        pairs: (p, 2), the numbers of a piece of `a` and of a piece of `b`.
        apart_m, measured_m: As in `measure_intrusion_depths`.
    """
    # Pairs that are surely apart count by the lower bound of their distance. The others are measured, nearest first,
    # and only at places where they may be deeper than what was found there before. The normals of sides come first,
    # since they bound the depth from above.
    bounds = _bound_distances(a, R_a, positions, b, T_b, pairs)
    deepest = np.where(bounds > measured_m, -bounds, -np.inf).max(axis=1, initial=-apart_m)
    closest = bounds.min(axis=0, initial=np.inf)
    order = np.flatnonzero(closest <= measured_m)
    for k in order[np.argsort(closest[order], kind="stable")]:
        i, j = pairs[k]
        bound = bounds[:, k]
        near = (bound <= measured_m) & (-bound > deepest)
        if not near.any():
            continue
        side_depths = np.full(len(positions), -np.inf)
        side_depths[near] = _least_projected_overlap(
            a[i], R_a, positions[near], b[j], T_b, list_side_axes(a[i], R_a, b[j], T_b[:3, :3])
        )
        near &= side_depths > deepest
        if near.any():
            edge_depths = _least_projected_overlap(
                a[i], R_a, positions[near], b[j], T_b, list_edge_axes(a[i], R_a, b[j], T_b[:3, :3])
            )
            deepest[near] = np.maximum(deepest[near], np.minimum(side_depths[near], edge_depths))
    return deepest


def _find_near_pairs(
    a: tuple[Piece, ...], R_a: Array, positions: Array, b: tuple[Piece, ...], T_b: Array, apart_m: float
) -> Any:
    """Pairs of pieces whose upright boxes, swept over all places, come nearer than `apart_m`: their numbers, (p, 2)."""
    ours, theirs = np.arange(len(a)), np.arange(len(b))
    if np.isinf(apart_m):
        return np.stack(np.meshgrid(ours, theirs, indexing="ij"), axis=-1).reshape(-1, 2)
    (mid_a, half_a), (mid_b, half_b) = _list_world_aligned_boxes(a, R_a), _list_world_aligned_boxes(b, T_b[:3, :3])
    slack = apart_m + TOUCH_M
    low_a, high_a = mid_a - half_a + positions.min(axis=0) - slack, mid_a + half_a + positions.max(axis=0) + slack
    low_b, high_b = mid_b - half_b + T_b[:3, 3], mid_b + half_b + T_b[:3, 3]
    # First the pieces of each solid that come near the box around all pieces of the other, then pair by pair.
    theirs = theirs[((low_b < high_a.max(axis=0)) & (high_b > low_a.min(axis=0))).all(axis=1)]
    if not len(theirs):
        return np.zeros((0, 2), dtype=np.intp)
    ours = ours[((low_a < high_b[theirs].max(axis=0)) & (high_a > low_b[theirs].min(axis=0))).all(axis=1)]
    near = np.ones((len(ours), len(theirs)), dtype=np.bool_)
    for axis in range(3):
        near &= low_a[ours, axis, None] < high_b[theirs, axis]
        near &= high_a[ours, axis, None] > low_b[theirs, axis]
    i, j = np.nonzero(near)
    return np.column_stack([ours[i], theirs[j]])


def _bound_distances(
    a: tuple[Piece, ...], R_a: Array, positions: Array, b: tuple[Piece, ...], T_b: Array, pairs: Any
) -> Array:
    """Lower bounds of the distance of each pair of pieces at each place, (k, p), [m]; negative where they may overlap.

    The bound is the larger one of the distances of enclosing balls and of upright boxes.
    """
    ours, theirs = pairs.T
    balls_a, radii_a = _list_bounding_balls(a)
    balls_b, radii_b = _list_bounding_balls(b)
    boxes_a, halves_a = _list_world_aligned_boxes(a, R_a)
    boxes_b, halves_b = _list_world_aligned_boxes(b, T_b[:3, :3])
    shift = positions - T_b[:3, 3]
    middles_a = balls_a @ R_a.T
    middles_b = balls_b @ T_b[:3, :3].T
    # One axis after the other: reducing arrays of (k, p, 3) along their last axis takes three times as long.
    ball_distances = np.zeros((len(positions), len(pairs)))
    box_distances = np.full(ball_distances.shape, -np.inf)
    for i in range(3):
        along = shift[:, i, None]
        offsets = along + middles_a[ours, i] - middles_b[theirs, i]
        ball_distances += offsets * offsets
        gap = along + boxes_a[ours, i] - boxes_b[theirs, i]
        np.abs(gap, out=gap)
        gap -= halves_a[ours, i] + halves_b[theirs, i]
        np.maximum(box_distances, gap, out=box_distances)
    np.sqrt(ball_distances, out=ball_distances)
    ball_distances -= radii_a[ours] + radii_b[theirs]
    return np.maximum(ball_distances, box_distances, out=box_distances)


def _list_world_aligned_boxes(pieces: tuple[Piece, ...], R: Array) -> tuple[Array, Array]:
    """Centres and half sizes, (k, 3) each, [m], of world-aligned boxes around pieces turned by R about the origin."""
    corners, first = collect_corners(pieces)
    turned = corners @ R.T
    low = np.minimum.reduceat(turned, first)
    high = np.maximum.reduceat(turned, first)
    return (low + high) / 2, (high - low) / 2


def _least_projected_overlap(a: Piece, R_a: Array, positions: Array, b: Piece, T_b: Array, axes: Array) -> Array:
    """The least overlap of the projections of two pieces over some axes, at k places, (k,), [m]; inf without axes."""
    middle_a, half_a = project_on_axes(a, R_a, axes)
    middle_b, half_b = project_on_axes(b, T_b[:3, :3], axes)
    distances = np.abs((positions - T_b[:3, 3]) @ axes.T + (middle_a - middle_b))
    return np.asarray((half_a + half_b - distances).min(axis=-1, initial=np.inf))


@lru_cache(maxsize=1024)
def _list_bounding_balls(pieces: tuple[Piece, ...]) -> tuple[Array, Array]:
    """Centres, (k, 3), and radii, (k,), of a ball around each piece, in the frame of the solid, [m]."""
    corners = [piece.corners for piece in pieces]
    radii = [np.linalg.norm(c - p.center, axis=1).max() for c, p in zip(corners, pieces, strict=True)]
    return copy_frozen([piece.center for piece in pieces], None, 3), copy_frozen(radii, None)


def measure_upright_bounds(pieces: tuple[Piece, ...], R: Array, position: Array) -> tuple[Array, Array]:
    """The lowest and the highest corner, (3,) each, of the world-aligned box around all posed pieces, [m].

    Args:
        R: (3, 3), their orientation, world.
        position: (3,), the position of their frame, world, [m].
    """
    if not all_boxes(pieces):
        corners = collect_corners(pieces)[0] @ R.T + position
        return corners.min(axis=0), corners.max(axis=0)
    centers, halves = list_bounding_boxes(pieces)
    middle = centers @ R.T + position
    extent = halves @ np.abs(R).T
    return (middle - extent).min(axis=0), (middle + extent).max(axis=0)


def measure_drop(a: Solid, T_a: Array, b: Solid, T_b: Array) -> float:
    """How far `a` can move down, along -z of the world, until it meets `b`, to 2 um, [m]; inf if it misses `b`."""
    low_a, high_a = measure_upright_bounds(a.pieces, T_a[:3, :3], T_a[:3, 3])
    low_b, high_b = measure_upright_bounds(b.pieces, T_b[:3, :3], T_b[:3, 3])
    if not ((low_a[:2] < high_b[:2]).all() and (low_b[:2] < high_a[:2]).all() and low_b[2] < high_a[2]):
        return np.inf
    # The upright boxes bound the drop between low and high. A coarse search finds the first drop with contact, a fine
    # one refines the interval between that and the drop before.
    low = max(0.0, float(low_a[2] - high_b[2]))
    high = float(high_a[2] - low_b[2])
    for step in (_STEP_M, TOUCH_M):
        drops = np.linspace(low, high, min(int((high - low) / step) + 2, _MOST_HEIGHTS))
        index = _find_first_contact(a, T_a, drops, b, T_b)
        if index is None:
            return np.inf
        low = float(drops[max(0, index - 1)])
        high = float(drops[index])
    return low


def _find_first_contact(a: Solid, T_a: Array, drops: Array, b: Solid, T_b: Array) -> int | None:
    """The index in `drops`, (k,), [m], of the first drop at which `a` is deeper in `b` than `TOUCH_M`; None if none
    is.
    """
    R_a, positions = T_a[:3, :3], T_a[:3, 3] - np.outer(drops, (0.0, 0.0, 1.0))
    if all_boxes(a.pieces) and all_boxes(b.pieces):
        pairs, pairs_per_drop = None, len(a.pieces) * len(b.pieces)
    else:
        pairs = _find_near_pairs(a.pieces, R_a, positions, b.pieces, T_b, 0.0)
        pairs_per_drop = max(1, len(pairs))
    count = max(1, _BATCH_SIZE // pairs_per_drop)
    for begin in range(0, len(drops), count):
        batch = positions[begin : begin + count]
        if pairs is None:
            depths = measure_intrusion_depths(a.pieces, R_a, batch, b.pieces, T_b)
        else:
            depths = _measure_pairs(a.pieces, R_a, batch, b.pieces, T_b, pairs, 0.0, 0.0)
        contacts = np.flatnonzero(depths > TOUCH_M)
        if len(contacts):
            return begin + int(contacts[0])
    return None


def measure_drop_depths(a: Solid, T_a: Array, drops: Array, b: Solid, T_b: Array) -> Array:
    """How deep `a` is in `b` after each of k drops along -z of the world, (k,), [m]; negative where they are apart."""
    return measure_intrusion_depths(a.pieces, T_a[:3, :3], T_a[:3, 3] - np.outer(drops, (0.0, 0.0, 1.0)), b.pieces, T_b)
