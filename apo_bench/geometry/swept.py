"""Exact contact intervals of convex pieces moved along a straight line, and the distance at which parts come free.

Two convex pieces overlap where their projections overlap on every separating axis. Along a line each projection
overlaps in one interval, so a pair of pieces meets in one interval of the way, the intersection of these.

In this file `way` is the unit vector of the motion, (3,), world. `slack_m` shrinks the pieces by so much before they
are compared; a negative value makes them larger.
"""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.convex import (
    collect_corners,
    enclose_in_ball,
    list_bounding_boxes,
    list_box_axes,
    list_edge_axes,
    list_side_axes,
    project_on_axes,
)
from apo_bench.geometry.polygon import find_plane_across
from apo_bench.geometry.solid import Piece, all_boxes

_ROUNDING_M = 1e-9
"""Slack of the comparisons of extents that rule out pairs of pieces, [m]."""
_TOUCH_DEPTH_M = 5e-5
"""Depth up to which two pieces only touch, [m]."""
_WHOLE_LINE = (-np.inf, np.inf)
"""The whole line, as an interval of the way."""


class PosedPieces(NamedTuple):
    """The convex pieces of a part, and its pose."""

    pieces: tuple[Piece, ...]
    T: Array
    """(4, 4), world, [m]."""


def _overlap_intervals_of_boxes(
    moving: PosedPieces,
    direction: Array,
    resting: PosedPieces,
    slack_m: float,
    within: tuple[float, float] = _WHOLE_LINE,
) -> tuple[NDArray[np.intp], Array]:
    """Intervals of the way in which the boxes around pairs of pieces overlap.

    Args:
        within: Interval of the way that matters, [m]; pairs that meet only outside it may be left out.

    Returns:
        The number of each pair, (k,), i * (number of resting pieces) + j, and begin and end of its interval, (k, 2),
        [m].
    """
    centers_a, centers_b = (pose.apply(part.T, list_bounding_boxes(part.pieces)[0]) for part in (moving, resting))
    R_a, R_b = (part.T[:3, :3] for part in (moving, resting))
    axes = list_box_axes(R_a, R_b)
    halves = [list_bounding_boxes(part.pieces)[1] @ np.abs(axes @ part.T[:3, :3]).T for part in (moving, resting)]
    # Most pairs miss each other, seen along the way, and are ruled out first.
    i, j = _find_near_pairs(moving, direction, resting, slack_m, within)
    distances = (centers_a @ axes.T)[i] - (centers_b @ axes.T)[j]
    kept, intervals = _solve_intervals(distances, axes @ direction, halves[0][i] + halves[1][j] - slack_m)
    return i[kept] * len(centers_b) + j[kept], intervals


def _find_near_pairs(
    moving: PosedPieces, direction: Array, resting: PosedPieces, slack_m: float, within: tuple[float, float]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Numbers of a moving and of a resting piece, (k,) each, of the pairs that may meet within an interval of the way.

    Their extents overlap on two axes perpendicular to the way, and on the way within that interval.
    """
    if all_boxes(moving.pieces) and all_boxes(resting.pieces):
        indices = np.indices((len(moving.pieces), len(resting.pieces))).reshape(2, -1)
        return indices[0], indices[1]
    near = np.ones((len(moving.pieces), len(resting.pieces)), dtype=np.bool_)
    margin = _ROUNDING_M - min(10.0 * slack_m, 0.0)  # with a negative slack, pieces reach farther
    for axis, (begin, end) in zip(
        (*find_plane_across(direction).T, direction), ((0.0, 0.0), (0.0, 0.0), within), strict=True
    ):
        (low_a, high_a), (low_b, high_b) = (_project_pieces(part, axis) for part in (moving, resting))
        near &= low_a[:, None] + begin < high_b + margin
        near &= high_a[:, None] + end > low_b - margin
    i, j = np.nonzero(near)
    return i, j


def _project_pieces(part: PosedPieces, axis: Array) -> tuple[Array, Array]:
    """Least and greatest coordinate of each piece on an axis, (k,) each, world, [m]."""
    corners, first = collect_corners(part.pieces)
    coordinates = corners @ (part.T[:3, :3].T @ axis) + part.T[:3, 3] @ axis
    return np.minimum.reduceat(coordinates, first), np.maximum.reduceat(coordinates, first)


def _overlap_interval_of_pair(
    moving: PosedPieces, direction: Array, resting: PosedPieces, slack_m: float, pair: int
) -> Array:
    """The interval of the way in which one pair of pieces overlaps, (1, 2), [m]; (0, 2) if there is none.

    Cross products of edges are tested only if the projections on the normals of sides overlap somewhere.

    Args:
        pair: The number of the pair, as returned by `_overlap_intervals_of_boxes`.
    """
    a, b = (part.pieces[i] for part, i in zip((moving, resting), divmod(pair, len(resting.pieces)), strict=True))
    R_a = moving.T[:3, :3]
    R_b = resting.T[:3, :3]
    offset = moving.T[:3, 3] - resting.T[:3, 3]

    def overlap_on_axes(axes: Array) -> Array:
        middle_a, half_a = project_on_axes(a, R_a, axes)
        middle_b, half_b = project_on_axes(b, R_b, axes)
        distances = middle_a - middle_b + axes @ offset
        half_sums = half_a + half_b - slack_m
        return _solve_intervals(distances[None], axes @ direction, half_sums[None])[1]

    sides = overlap_on_axes(list_side_axes(a, R_a, b, R_b))
    edges = overlap_on_axes(list_edge_axes(a, R_a, b, R_b)) if len(sides) else sides
    if not len(edges):
        return edges
    low = max(sides[0, 0], edges[0, 0])
    high = min(sides[0, 1], edges[0, 1])
    return np.array([[low, high]]) if low < high else np.zeros((0, 2))


def is_path_free(
    moving: Sequence[PosedPieces], direction: Array, length_m: float, resting: Sequence[PosedPieces]
) -> bool:
    """Whether parts, moved together as one by `length_m` along `direction`, collide with none of the resting parts."""
    for moving_part, resting_part in product(moving, resting):
        if _balls_meet(moving_part, direction, length_m, resting_part):
            pairs, intervals = _overlap_intervals_of_boxes(
                moving_part, direction, resting_part, _TOUCH_DEPTH_M, (0.0, length_m)
            )
            if not (all_boxes(moving_part.pieces) and all_boxes(resting_part.pieces)):
                # One pair that meets is enough, so the pairs whose boxes overlap longest are tested first.
                overlaps = np.minimum(intervals[:, 1], length_m) - np.maximum(intervals[:, 0], 0.0)
                order = np.flatnonzero(overlaps > 0.0)
                order = order[np.argsort(-overlaps[order], kind="stable")]
                exact = (
                    _overlap_interval_of_pair(moving_part, direction, resting_part, _TOUCH_DEPTH_M, int(pairs[k]))
                    for k in order
                )
                intervals = next(
                    (interval for interval in exact if _any_overlaps(interval, length_m)), np.zeros((0, 2))
                )
            if _any_overlaps(intervals, length_m):
                return False
    return True


def _any_overlaps(intervals: Array, length_m: float) -> bool:
    """Whether one of some intervals, (k, 2), overlaps the interval from 0 to `length_m`."""
    return bool(((intervals[:, 1] > 0.0) & (intervals[:, 0] < length_m)).any())


def compute_exit_distance(moving: Sequence[PosedPieces], direction: Array, resting: Sequence[PosedPieces]) -> float:
    """How far parts, moved together as one along `direction`, must go until they touch no resting part any more, [m].

    Only the overlap that begins at the start counts. Pairs other than boxes are compared by the boxes around them
    first, the latest to come free first, and exactly only where that matters.
    """
    bounds = list[Array]()
    exact = list[bool]()
    owners = list[tuple[PosedPieces, PosedPieces, int]]()
    for moving_part, resting_part in product(moving, resting):
        pairs, intervals = _overlap_intervals_of_boxes(moving_part, direction, resting_part, -_TOUCH_DEPTH_M)
        bounds += list(intervals)
        exact += [all_boxes(moving_part.pieces) and all_boxes(resting_part.pieces)] * len(intervals)
        owners += [(moving_part, resting_part, int(pair)) for pair in pairs]
    # Follow the intervals that overlap from 0 on: each one that begins before the end so far moves that end outwards.
    exit_m = 0.0
    low, high = np.array(bounds).reshape(-1, 2).T.copy()
    order = np.argsort(-high, kind="stable")
    while (overlaps := (low[order] <= exit_m) & (high[order] > exit_m)).any():
        i = order[overlaps.argmax()]
        if not exact[i]:
            moving_part, resting_part, pair = owners[i]
            interval = _overlap_interval_of_pair(moving_part, direction, resting_part, -_TOUCH_DEPTH_M, pair)
            low[i], high[i] = interval[0] if len(interval) else (np.inf, -np.inf)
            exact[i] = True
        if low[i] <= exit_m < high[i]:
            exit_m = float(high[i])
    return max(0.0, exit_m - _TOUCH_DEPTH_M)


def _balls_meet(moving: PosedPieces, direction: Array, length_m: float, resting: PosedPieces) -> bool:
    """Whether the balls around two parts meet anywhere on the way; rules out most pairs of parts."""
    local_a, radius_a = enclose_in_ball(moving.pieces)
    local_b, radius_b = enclose_in_ball(resting.pieces)
    center_a = moving.T[:3, :3] @ local_a + moving.T[:3, 3]
    center_b = resting.T[:3, :3] @ local_b + resting.T[:3, 3]
    nearest_m = float(np.clip((center_b - center_a) @ direction, 0.0, length_m))
    return bool(np.linalg.norm(center_a + nearest_m * direction - center_b) < radius_a + radius_b)


def _solve_intervals(distances: Array, speed: Array, half_sums: Array) -> tuple[NDArray[np.intp], Array]:
    """Intervals of s in which |at + s * speed| < reach holds for all axes at once.

    Args:
        distances: Distance of the centres of each pair on each axis at s = 0, (k, axes), [m].
        speed: Its change per metre of the way, (axes,).
        half_sums: Sum of the half lengths of the projections, (k, axes), [m].

    Returns:
        The rows for which there is an interval, (l,), and begin and end of each, (l, 2), [m].
    """
    # The condition holds between s = (-reach - at) / speed and s = (reach - at) / speed, in either order; where the
    # speed is zero it holds always or never.
    is_constant = np.abs(speed) < 1e-9
    never = (np.abs(distances) >= half_sums) & is_constant
    rate = np.where(is_constant, 1.0, speed)
    ends = np.stack([(-half_sums - distances) / rate, (half_sums - distances) / rate])
    low = np.where(is_constant, -np.inf, ends.min(axis=0)).max(axis=1)
    high = np.where(is_constant, np.inf, ends.max(axis=0)).min(axis=1)
    kept = (low < high) & ~never.any(axis=1) & (half_sums > 0.0).all(axis=1)
    return np.flatnonzero(kept), np.column_stack([low[kept], high[kept]])
