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
    across_edges,
    across_sides,
    box_axes,
    boxes_around,
    collect_corners,
    enclose_in_ball,
    project_on_axes,
)
from apo_bench.geometry.polygon import find_plane_across
from apo_bench.geometry.solid import Piece, all_boxes

_ROUNDING_M = 1e-9
"""Slack of the comparisons of extents that rule out pairs of pieces, [m]."""
_SLACK_M = 5e-5
"""Depth up to which two pieces only touch, [m]."""
_ANYWHERE = (-np.inf, np.inf)
"""The whole line, as an interval of the way."""


class PosedPieces(NamedTuple):
    """The convex pieces of a part, and its pose."""

    pieces: tuple[Piece, ...]
    T: Array
    """(4, 4), world, [m]."""


def _box_spans(
    moving: PosedPieces, way: Array, resting: PosedPieces, slack_m: float, within: tuple[float, float] = _ANYWHERE
) -> tuple[NDArray[np.intp], Array]:
    """Intervals of the way in which the boxes around pairs of pieces overlap.

    Args:
        within: Interval of the way that matters, [m]; pairs that meet only outside it may be left out.

    Returns:
        The number of each pair, (k,), i * (number of resting pieces) + j, and begin and end of its interval, (k, 2),
        [m].
    """
    a, b = (pose.apply(of.T, boxes_around(of.pieces)[0]) for of in (moving, resting))
    R_a, R_b = (of.T[:3, :3] for of in (moving, resting))
    axes = box_axes(R_a, R_b)
    halves = [boxes_around(of.pieces)[1] @ np.abs(axes @ of.T[:3, :3]).T for of in (moving, resting)]
    # Most pairs miss each other, seen along the way, and are ruled out first.
    i, j = _side_by_side(moving, way, resting, slack_m, within)
    at = (a @ axes.T)[i] - (b @ axes.T)[j]
    kept, spans = _intervals(at, axes @ way, halves[0][i] + halves[1][j] - slack_m)
    return i[kept] * len(b) + j[kept], spans


def _side_by_side(
    moving: PosedPieces, way: Array, resting: PosedPieces, slack_m: float, within: tuple[float, float]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Numbers of a moving and of a resting piece, (k,) each, of the pairs that may meet within an interval of the way.

    Their extents overlap on two axes perpendicular to the way, and on the way within that interval.
    """
    if all_boxes(moving.pieces) and all_boxes(resting.pieces):
        every = np.indices((len(moving.pieces), len(resting.pieces))).reshape(2, -1)
        return every[0], every[1]
    near = np.ones((len(moving.pieces), len(resting.pieces)), dtype=np.bool_)
    room = _ROUNDING_M - min(10.0 * slack_m, 0.0)  # with a negative slack, pieces reach farther
    for axis, (begin, end) in zip((*find_plane_across(way).T, way), ((0.0, 0.0), (0.0, 0.0), within), strict=True):
        (low_a, high_a), (low_b, high_b) = (_ends(of, axis) for of in (moving, resting))
        near &= low_a[:, None] + begin < high_b + room
        near &= high_a[:, None] + end > low_b - room
    i, j = np.nonzero(near)
    return i, j


def _ends(of: PosedPieces, axis: Array) -> tuple[Array, Array]:
    """Least and greatest coordinate of each piece on an axis, (k,) each, world, [m]."""
    corners, first = collect_corners(of.pieces)
    along = corners @ (of.T[:3, :3].T @ axis) + of.T[:3, 3] @ axis
    return np.minimum.reduceat(along, first), np.maximum.reduceat(along, first)


def _exactly(moving: PosedPieces, way: Array, resting: PosedPieces, slack_m: float, pair: int) -> Array:
    """The interval of the way in which one pair of pieces overlaps, (1, 2), [m]; (0, 2) if there is none.

    Cross products of edges are tested only if the projections on the normals of sides overlap somewhere.

    Args:
        pair: The number of the pair, as returned by `_box_spans`.
    """
    a, b = (of.pieces[i] for of, i in zip((moving, resting), divmod(pair, len(resting.pieces)), strict=True))
    R_a = moving.T[:3, :3]
    R_b = resting.T[:3, :3]
    between = moving.T[:3, 3] - resting.T[:3, 3]

    def meet(axes: Array) -> Array:
        middle_a, half_a = project_on_axes(a, R_a, axes)
        middle_b, half_b = project_on_axes(b, R_b, axes)
        at = middle_a - middle_b + axes @ between
        reach = half_a + half_b - slack_m
        return _intervals(at[None], axes @ way, reach[None])[1]

    sides = meet(across_sides(a, R_a, b, R_b))
    edges = meet(across_edges(a, R_a, b, R_b)) if len(sides) else sides
    if not len(edges):
        return edges
    low = max(sides[0, 0], edges[0, 0])
    high = min(sides[0, 1], edges[0, 1])
    return np.array([[low, high]]) if low < high else np.zeros((0, 2))


def is_way_free(moving: Sequence[PosedPieces], way: Array, length_m: float, resting: Sequence[PosedPieces]) -> bool:
    """Whether parts, moved together as one by `length_m` along `way`, collide with none of the resting parts."""
    for m, r in product(moving, resting):
        if _near(m, way, length_m, r):
            pairs, spans = _box_spans(m, way, r, _SLACK_M, (0.0, length_m))
            if not (all_boxes(m.pieces) and all_boxes(r.pieces)):
                # One pair that meets is enough, so the pairs whose boxes overlap longest are tested first.
                meet = np.minimum(spans[:, 1], length_m) - np.maximum(spans[:, 0], 0.0)
                order = np.flatnonzero(meet > 0.0)
                order = order[np.argsort(-meet[order], kind="stable")]
                exact = (_exactly(m, way, r, _SLACK_M, int(pairs[k])) for k in order)
                spans = next((span for span in exact if _within(span, length_m)), np.zeros((0, 2)))
            if _within(spans, length_m):
                return False
    return True


def _within(spans: Array, length_m: float) -> bool:
    """Whether one of some intervals, (k, 2), overlaps the interval from 0 to `length_m`."""
    return bool(((spans[:, 1] > 0.0) & (spans[:, 0] < length_m)).any())


def compute_exit_distance(moving: Sequence[PosedPieces], way: Array, resting: Sequence[PosedPieces]) -> float:
    """How far parts, moved together as one along `way`, must go until they touch no resting part any more, [m].

    Only the overlap that begins at the start counts. Pairs other than boxes are compared by the boxes around them
    first, the latest to come free first, and exactly only where that matters.
    """
    spans = list[Array]()
    exact = list[bool]()
    owners = list[tuple[PosedPieces, PosedPieces, int]]()
    for m, r in product(moving, resting):
        pairs, intervals = _box_spans(m, way, r, -_SLACK_M)
        spans += list(intervals)
        exact += [all_boxes(m.pieces) and all_boxes(r.pieces)] * len(intervals)
        owners += [(m, r, int(k)) for k in pairs]
    # Follow the intervals that overlap from 0 on: each one that begins before the end so far moves that end outwards.
    at = 0.0
    low, high = np.array(spans).reshape(-1, 2).T.copy()
    order = np.argsort(-high, kind="stable")
    while (over := (low[order] <= at) & (high[order] > at)).any():
        i = order[over.argmax()]
        if not exact[i]:
            m, r, k = owners[i]
            met = _exactly(m, way, r, -_SLACK_M, k)
            low[i], high[i] = met[0] if len(met) else (np.inf, -np.inf)
            exact[i] = True
        if low[i] <= at < high[i]:
            at = float(high[i])
    return max(0.0, at - _SLACK_M)


def _near(moving: PosedPieces, way: Array, length_m: float, resting: PosedPieces) -> bool:
    """Whether the balls around two parts meet anywhere on the way; rules out most pairs of parts."""
    middle_a, r_a = enclose_in_ball(moving.pieces)
    middle_b, r_b = enclose_in_ball(resting.pieces)
    a = moving.T[:3, :3] @ middle_a + moving.T[:3, 3]
    b = resting.T[:3, :3] @ middle_b + resting.T[:3, 3]
    passed = float(np.clip((b - a) @ way, 0.0, length_m))
    return bool(np.linalg.norm(a + passed * way - b) < r_a + r_b)


def _intervals(at: Array, speed: Array, reach: Array) -> tuple[NDArray[np.intp], Array]:
    """Intervals of s in which |at + s * speed| < reach holds for all axes at once.

    Args:
        at: Distance of the centres of each pair on each axis at s = 0, (k, axes), [m].
        speed: Its change per metre of the way, (axes,).
        reach: Sum of the half lengths of the projections, (k, axes), [m].

    Returns:
        The rows for which there is an interval, (l,), and begin and end of each, (l, 2), [m].
    """
    # The condition holds between s = (-reach - at) / speed and s = (reach - at) / speed, in either order; where the
    # speed is zero it holds always or never.
    still = np.abs(speed) < 1e-9
    apart = (np.abs(at) >= reach) & still
    rate = np.where(still, 1.0, speed)
    ends = np.stack([(-reach - at) / rate, (reach - at) / rate])
    low = np.where(still, -np.inf, ends.min(axis=0)).max(axis=1)
    high = np.where(still, np.inf, ends.max(axis=0)).min(axis=1)
    kept = (low < high) & ~apart.any(axis=1) & (reach > 0.0).all(axis=1)
    return np.flatnonzero(kept), np.column_stack([low[kept], high[kept]])
