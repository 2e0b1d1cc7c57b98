"""Where two flat pads that come from above can hold a part: its thickness along level rays, and the places it offers.

Pads hold what begins and ends at the same places along all rays of some length: opposite flat faces, a shaft's wall.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.convex import collect_corners, measure_passage
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.polygon import find_plane_across
from apo_bench.geometry.solid import Piece, Solid, measure_extent

PAD_M = (0.016, 0.010, 0.026)
"""How far pads reach from between their tips: to each side, down and up, [m]."""
_FINGER_M = 0.012
FINGER_ROOM_M = 0.012
"""How thick a finger is; how far it stands off before it closes."""
_PALM_M = 0.060
_OVER_M = 0.0115
"""A part reaches at most so far up next to the tips, which are at least so high above what it stands on."""
_RAY_M = 0.003
_FINE_M = 0.001
_FLAT_M = 1e-4
_LINE_M = 0.003
"""Rays are so far apart, and rows of them so where that finds nothing, as on a thin flange; surfaces so deep behind the
outermost one are pressed, too; and so long at least."""
_PINCH_M = 0.006
_PINCH_RAY_M = 0.0005
"""Tips that are farther over the top pinch it: rays are denser, and a shorter line will do."""
_ROUNDING_M = 1e-6
_TINY_M = 1e-8
"""Heights are rounded."""
_LEVEL = 1e-3
_HEIGHT = 0.65
"""Height of the tips over the part's lowest point that is best, as a part of its height."""
_LESS_M = 0.002
_UNEVEN_M = 0.003
"""So much farther from the middle a flat hold may be than a line on a shaft."""


class PadPlace(NamedTuple):
    """A place for the pads; in the frame of the part, [m]."""

    point: Array
    """Between the tips, (3,)."""
    across: Array
    """Along which they close, unit vector, (3,)."""
    half_width: float


class _Rays(NamedTuple):
    """What rays along a direction pass through."""

    t: Array
    """Where each ray is across their direction and the vertical, (r,)."""
    h: Array
    """How high each ray is, (r,)."""
    low: Array
    """Where they enter the pieces that they pass through, in rising order, (r, m); infinite behind the last."""
    high: Array


def measure_held_span(pieces: tuple[Piece, ...], point: Array, across: Array, up: Array) -> tuple[float, float] | None:
    """From where to where the part reaches between pads that close on a point, [m] from it; None: nothing is there.

    Pads that close on the gap between two arms of a part press these towards each other.

    Args:
        up: The vertical, unit vector, (3,), frame of the part.
    """
    along = np.cross(up, across)
    side, down, over = PAD_M
    t = float(point @ along)
    h = float(point @ up)
    columns = _lines(t - side, t + side, _axes_within(pieces, along, t - side, t + side))
    rows = _lines(h - down, h + over, _axes_within(pieces, up, h - down, h + over))
    rays = _cast(pieces, across, up, columns, rows)
    here = float(point @ across)
    spans = _clusters(rays, np.ones(len(rays.t), dtype=np.bool_))
    begins = [low for low, _ in spans if low < here]
    ends = [high for _, high in spans if high > here]
    return (begins[-1] - here, ends[0] - here) if begins and ends else None


@lru_cache(maxsize=4096)
def measure_held_width(
    pieces: tuple[Piece, ...], point: tuple[float, ...], across: tuple[float, ...], up: tuple[float, ...]
) -> float | None:
    """Half of the width of what pads hold that close on a point, [m]; None if there is nothing between them."""
    span = measure_held_span(pieces, np.array(point), np.array(across), np.array(up))
    return None if span is None else (span[1] - span[0]) / 2


def holds_whole(pieces: tuple[Piece, ...], point: Array, across: Array, up: Array) -> bool:
    """Whether pads hold all the width of a part, not an arm of it, nor the air next to it."""
    low, high = measure_extent(pieces, across)
    own = measure_held_width(pieces, tuple(point), tuple(across), tuple(up))
    return own is not None and own > (high - low) / 2 - _LESS_M


def find_holds(solid: Solid, up: Array, opening_m: float, over_m: float = 0.0) -> tuple[PadPlace, ...]:
    """Places at which a gripper from above can hold a part, the best first: near the centre of mass, and not too low.

    Args:
        up: The vertical, unit vector, (3,), frame of the part.
        opening_m: Of each finger, [m].
        over_m: So far over the top of the part tips may be; pads reach below them.
    """
    asks = solid, tuple(map(float, up)), opening_m, over_m
    if over_m > _PINCH_M:
        return _places(*asks, _PINCH_RAY_M)
    return _places(*asks, _RAY_M) or _places(*asks, _FINE_M)


def is_held(solid: Solid, point: Array, across: Array, up: Array, opening_m: float) -> bool:
    """Whether pads that close on a point lie flat on the part, or on a shaft; arguments as in `find_holds`."""
    along = np.cross(up, across)
    t, h, here = (float(point @ axis) for axis in (along, up, across))
    for rim in (0.0, _RAY_M):  # what is just below the pads may join what they hold, or be in their way
        ends = (t - PAD_M[0] - rim, t + PAD_M[0] + rim), (h - PAD_M[1] - rim, h + PAD_M[2])
        columns, rows = (
            _lines(*each, [mid, *_round_axes(solid, axis, *each)], _PINCH_RAY_M)
            for each, mid, axis in zip(ends, (t, h), (along, up), strict=True)
        )
        offers = _offers(_cast(solid.pieces, across, up, columns, rows), t, h, opening_m, _FINE_M)
        if any(low < here < high for low, high, _ in offers):
            return True
    return False


def _round_axes(solid: Solid, axis: Array, low: float, high: float) -> list[float]:
    """Where the axes of round faces that lie square to an axis are along it, between two places."""
    places = [float(f.point @ axis) for f in solid.rounds.values() if abs(f.axis @ axis) < _LEVEL]
    return [x for x in places if low < x < high]


def _axes_within(pieces: tuple[Piece, ...], axis: Array, low: float, high: float) -> list[float]:
    """Where the middles of cylinders are along an axis, between two places."""
    middles = [float(p.cylinder.center @ axis) for p in pieces if isinstance(p, Hull) and p.cylinder is not None]
    return [x for x in middles if low < x < high]


@lru_cache(maxsize=128)
def _places(
    solid: Solid, vertical: tuple[float, ...], opening_m: float, over_m: float, ray_m: float
) -> tuple[PadPlace, ...]:
    """`find_holds`, with rows of rays so far apart, [m]."""
    up = np.array(vertical)
    bottom, top = measure_extent(solid.pieces, up)
    best = max(bottom + _HEIGHT * (top - bottom), bottom + _OVER_M, top - _PALM_M)
    least, step = (_LINE_M, _RAY_M) if over_m <= _PINCH_M else (_FINE_M, _PINCH_RAY_M)
    heights = _lines(bottom, max(top + over_m, best), [best], step)
    tips = heights[heights >= max(bottom + _OVER_M, top - _PALM_M) - _TINY_M]
    candidates: list[tuple[float, PadPlace]] = []
    for across in _directions(solid, up):
        along = np.cross(up, across)
        low, high = measure_extent(solid.pieces, along)
        t = _lines(low, high, [float(f.point @ along) for f in solid.rounds.values() if abs(f.axis @ up) > 1 - _LEVEL])
        level = [float(f.point @ up) for f in solid.rounds.values() if abs(f.axis @ up) < _LEVEL]
        rays = _cast(solid.pieces, across, up, t, _lines(bottom, top, level, ray_m))
        for tip in tips:
            for place in t:
                for low, high, uneven in _offers(rays, place, tip, opening_m, least):
                    point = (low + high) / 2 * across + place * along + tip * up
                    off = np.abs([(point - solid.centroid) @ across, (point - solid.centroid) @ along]).sum()
                    cost = float(off + 0.5 * abs(tip - best) + 0.25 * (high - low) + _UNEVEN_M * uneven)
                    candidates.append((round(cost, 9), PadPlace(point, across, (high - low) / 2)))
    return tuple(hold for _, hold in sorted(candidates, key=lambda each: each[0]))


def _directions(solid: Solid, up: Array) -> Iterator[Array]:
    """Level directions in which pads may close, each once up to its sign."""
    ways = [face.normal for face in solid.faces.values() if abs(face.normal @ up) < _LEVEL]
    for face in (face for face in solid.rounds.values() if not face.hole and face.kind == "cylinder"):
        if abs(face.axis @ up) > 1.0 - _LEVEL:
            x, y = (np.asarray(axis - (axis @ up) * up) for axis in find_plane_across(up).T)
            ways += [x, y, (x + y) / np.sqrt(2.0), (x - y) / np.sqrt(2.0)]
        else:
            ways.append(np.cross(up, face.axis))
    kept: list[Array] = []
    for way in ways:
        way = way - (way @ up) * up
        way = way / np.linalg.norm(way)
        if all(abs(way @ other) < 1.0 - 1e-6 for other in kept):
            kept.append(way)
            yield np.asarray(way * np.sign(way[np.abs(way).argmax()]) + 0.0)


def _lines(low: float, high: float, also: Sequence[float], ray_m: float = _RAY_M) -> Array:
    """Places from one end to the other, the middle among them, just inside, and some more."""
    middle = (low + high) / 2
    reach = (high - low) / 2 - 1e-6
    n = max(4, int(np.ceil(reach / ray_m)))
    return np.unique(np.round(np.append(middle + np.linspace(-reach, reach, 2 * n + 1), also), 9))


def _cast(pieces: tuple[Piece, ...], across: Array, up: Array, t: Array, h: Array) -> _Rays:
    """Send rays along a direction through all places of a grid, each way in rising order."""
    along = np.cross(up, across)
    corners, first = collect_corners(pieces)
    (t0, t1), (h0, h1) = (_over(places, corners @ axis, first) for places, axis in ((t, along), (h, up)))
    met = np.flatnonzero((t0 < t1) & (h0 < h1))
    T, H = np.meshgrid(t, h)
    start = T[..., None] * along + H[..., None] * up
    number = np.arange(T.size).reshape(T.shape)
    rays, lows, highs = [np.zeros(0, dtype=np.intp)], [np.zeros(0)], [np.zeros(0)]
    for i in met:
        here = slice(h0[i], h1[i]), slice(t0[i], t1[i])
        enter, leave = measure_passage(pieces[i].planes, start[here].reshape(-1, 3), across)
        hit = np.isfinite(enter)
        rays.append(number[here].ravel()[hit])
        lows.append(enter[hit])
        highs.append(leave[hit])
    # Of each ray what it passes through, one behind the other: most pass through few of many pieces.
    ray, low, high = (np.concatenate(each) for each in (rays, lows, highs))
    order = np.lexsort((low, ray))
    ray = ray[order]
    place = np.arange(len(ray)) - np.searchsorted(ray, ray)
    ends = [np.full((T.size, int(place.max(initial=0)) + 1), empty) for empty in (np.inf, -np.inf)]
    for end, values in zip(ends, (low, high), strict=True):
        end[ray, place] = values[order]
    return _Rays(T.ravel(), H.ravel(), *ends)


def _over(places: Array, at: Array, first: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Of rising places, the first in the shadow of each piece and the one behind its last."""
    low = np.searchsorted(places, np.minimum.reduceat(at, first) - _ROUNDING_M)
    return low, np.searchsorted(places, np.maximum.reduceat(at, first) + _ROUNDING_M)


def _clusters(rays: _Rays, within: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """From where to where there is something, [m], one after the other; gaps that no finger fits into do not count."""
    low = rays.low[within]
    high = rays.high[within]
    there = np.isfinite(low)
    if not there.any():
        return []
    order = np.argsort(low[there])
    low = low[there][order]
    reached = np.maximum.accumulate(high[there][order])
    apart = low[1:] >= reached[:-1] + _FINGER_M + FINGER_ROOM_M
    begins = np.append(low[0], low[1:][apart])
    ends = np.append(reached[:-1][apart], reached[-1])
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _offers(rays: _Rays, t: float, h: float, opening_m: float, least: float) -> Iterator[tuple[float, float, bool]]:
    """What pads between (t, h) can hold along so much, [m]: from where to where, and whether along a line only."""
    side, down, over = PAD_M
    above = (np.abs(rays.t - t) <= side + _RAY_M) & (rays.h >= h - down - _RAY_M)
    within = above & (rays.h <= h + over)
    on = ((np.abs(rays.t - t) <= side) & (rays.h >= h - down))[within]
    enter, leave = rays.low[within], rays.high[within]
    for low, high in _clusters(rays, within):
        if (high - low) / 2 + FINGER_ROOM_M / 2 > opening_m or _in_the_way(rays, above, low, high):
            continue
        own = np.where((enter >= low - 1e-9) & (leave <= high + 1e-9), 1.0, np.nan)
        with np.errstate(invalid="ignore"):
            first = np.fmin.reduce(enter * own, axis=1)
            last = np.fmax.reduce(leave * own, axis=1)
            pressed = on & (first < low + _FLAT_M) & (last > high - _FLAT_M)
        if (np.abs(rays.t[within][pressed] - t) < side / 3).any():
            lengths = [float(np.ptp(places[within][pressed])) for places in (rays.t, rays.h)]
            if max(lengths) >= least:
                yield low, high, min(lengths) < _LINE_M


def _in_the_way(rays: _Rays, above: NDArray[np.bool_], low: float, high: float) -> bool:
    """Whether a finger, open or on its way down, would strike the part itself."""
    room = _FINGER_M + FINGER_ROOM_M
    beside = (low - room, low - 1e-6), (high + 1e-6, high + room)
    return any(bool(((rays.low[above] < end) & (rays.high[above] > begin)).any()) for begin, end in beside)
