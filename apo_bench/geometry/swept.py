"""Pieces moved along a straight line against pieces that rest: exactly where they meet, and where they come free.

Two convex pieces overlap where their shadows do along every separating axis; along a line each shadow does so in an
interval, so each pair of pieces meets in one interval of the way.
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
    ball_around,
    box_axes,
    boxes_around,
    boxes_reach,
    shadow,
)
from apo_bench.geometry.solid import Piece, all_boxes

_SLACK_M = 5e-5
"""Pieces are less than this deep in each other where they touch."""
_ANYWHERE = (-np.inf, np.inf)


class Posed(NamedTuple):
    """The pieces of a part somewhere."""

    pieces: tuple[Piece, ...]
    T: Array
    """(4, 4), world, [m]."""


def overlap_intervals(
    moving: Posed, way: Array, resting: Posed, slack_m: float = _SLACK_M, within: tuple[float, float] = _ANYWHERE
) -> Array:
    """Where along a line the pieces of two parts overlap by more than a slack, (k, 2), [m]: from and until.

    Args:
        way: Unit vector of the motion, (3,), world.
        slack_m: Negative: pieces count that are still this far apart.
        within: Overlaps that end before or begin after these places may be left out, [m].
    """
    pairs, spans = _boxed(moving, way, resting, slack_m)
    if all_boxes(moving.pieces) and all_boxes(resting.pieces):
        return spans
    near = (spans[:, 1] > within[0]) & (spans[:, 0] < within[1])
    exact = [_exactly(moving, way, resting, slack_m, int(k)) for k in pairs[near]]
    return np.concatenate([np.zeros((0, 2)), *exact])


def _boxed(moving: Posed, way: Array, resting: Posed, slack_m: float) -> tuple[NDArray[np.intp], Array]:
    """Which pairs of pieces, by number, the boxes around them meet on a line, (k,), and from and until, (k, 2)."""
    a, b = (pose.apply(of.T, boxes_around(of.pieces)[0]) for of in (moving, resting))
    R_a, R_b = (of.T[:3, :3] for of in (moving, resting))
    axes = box_axes(R_a, R_b)
    reach = boxes_reach(moving.pieces, R_a, resting.pieces, R_b, axes).reshape(-1, len(axes)) - slack_m
    at = ((a @ axes.T)[:, None] - (b @ axes.T)[None]).reshape(-1, len(axes))
    return _intervals(at, axes @ way, reach)


def _exactly(moving: Posed, way: Array, resting: Posed, slack_m: float, pair: int) -> Array:
    """Where the pieces of a pair meet, (1, 2), or nowhere, (0, 2): across their sides, then across edges."""
    a, b = (of.pieces[i] for of, i in zip((moving, resting), divmod(pair, len(resting.pieces)), strict=True))
    R_a = moving.T[:3, :3]
    R_b = resting.T[:3, :3]
    between = moving.T[:3, 3] - resting.T[:3, 3]

    def meet(axes: Array) -> Array:
        middle_a, half_a = shadow(a, R_a, axes)
        middle_b, half_b = shadow(b, R_b, axes)
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


def is_way_free(moving: Sequence[Posed], way: Array, length_m: float, resting: Sequence[Posed]) -> bool:
    """Whether parts can be moved so far as one without coming into any other."""
    for m, r in product(moving, resting):
        if _near(m, way, length_m, r):
            spans = overlap_intervals(m, way, r, within=(0.0, length_m))
            if ((spans[:, 1] > 0.0) & (spans[:, 0] < length_m)).any():
                return False
    return True


def exit_distance(moving: Sequence[Posed], way: Array, resting: Sequence[Posed]) -> float:
    """How far parts must be moved as one until they touch none of the others any more, [m]: the end of the overlap.

    Pieces that are no boxes are compared by the boxes around them first, those that go on the longest before others.
    """
    spans = list[Array]()
    exact = list[bool]()
    owners = list[tuple[Posed, Posed, int]]()
    for m, r in product(moving, resting):
        pairs, intervals = _boxed(m, way, r, -_SLACK_M)
        spans += list(intervals)
        exact += [all_boxes(m.pieces) and all_boxes(r.pieces)] * len(intervals)
        owners += [(m, r, int(k)) for k in pairs]
    # Follow the intervals that overlap from 0 on: each one that begins before the end so far moves that end outwards.
    at = 0.0
    order = np.argsort([-span[1] for span in spans], kind="stable")
    while (i := next((i for i in order if spans[i][0] <= at < spans[i][1]), None)) is not None:
        if not exact[i]:
            m, r, k = owners[i]
            met = _exactly(m, way, r, -_SLACK_M, k)
            spans[i] = met[0] if len(met) else np.array([np.inf, -np.inf])
            exact[i] = True
        if spans[i][0] <= at < spans[i][1]:
            at = float(spans[i][1])
    return max(0.0, at - _SLACK_M)


def _near(moving: Posed, way: Array, length_m: float, resting: Posed) -> bool:
    """Whether balls around two parts come near each other on the way; most parts are far away."""
    middle_a, r_a = ball_around(moving.pieces)
    middle_b, r_b = ball_around(resting.pieces)
    a = moving.T[:3, :3] @ middle_a + moving.T[:3, 3]
    b = resting.T[:3, :3] @ middle_b + resting.T[:3, 3]
    passed = float(np.clip((b - a) @ way, 0.0, length_m))
    return bool(np.linalg.norm(a + passed * way - b) < r_a + r_b)


def _intervals(at: Array, speed: Array, reach: Array) -> tuple[NDArray[np.intp], Array]:
    """Where |at + s speed| < reach holds along all axes at once: (k, axes) -> which rows, (l,), and from and until,
    (l, 2); rows where it holds nowhere are left out."""
    # It holds between s = (-reach - at) / speed and s = (reach - at) / speed, in either order; where the speed is zero
    # always or never.
    still = np.abs(speed) < 1e-9
    apart = (np.abs(at) >= reach) & still
    rate = np.where(still, 1.0, speed)
    ends = np.stack([(-reach - at) / rate, (reach - at) / rate])
    low = np.where(still, -np.inf, ends.min(axis=0)).max(axis=1)
    high = np.where(still, np.inf, ends.max(axis=0)).min(axis=1)
    kept = (low < high) & ~apart.any(axis=1) & (reach > 0.0).all(axis=1)
    return np.flatnonzero(kept), np.column_stack([low[kept], high[kept]])
