"""Places on a part that two flat pads of a gripper from above can hold, found by ray casting.

Level rays through the convex pieces give the thickness of the part at every height. Pads hold what begins and ends at
the same places along neighbouring rays: opposite flat faces, or the wall of a shaft along a line.

In this file `up` is the vertical, `across` the level direction along which the pads close, and `along` = up x across.
On these axes t is the coordinate along `along`, h the one along `up`.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.pad_rays import (
    FINGER_CLEARANCE_M,
    RAY_SPACING_M,
    PadRays,
    blocks_finger,
    cast_ray_grid,
    list_grid_coordinates,
    merge_narrow_gaps,
)
from apo_bench.geometry.polygon import find_plane_across
from apo_bench.geometry.solid import Piece, Solid, measure_extent

PAD_M = (0.016, 0.010, 0.026)
"""Extent of a pad from the point between the tips: to each side, down and up, [m]."""
_PALM_HEIGHT_M = 0.060
"""Height of the palm above the tips, [m]: the part may reach at most so far above them."""
_LEAST_TIP_HEIGHT_M = 0.0115
"""Least height of the tips above the lowest point of the part, [m], so that the pads clear what the part stands on."""
_FINE_SPACING_M = 0.001
"""Spacing of the rows of rays where `RAY_SPACING_M` finds no hold, [m], as on a thin flange; also least length of a
pinch."""
_PRESSED_DEPTH_M = 1e-4
"""Surfaces that lie at most so far behind the outermost one are pressed by the pad too, [m]."""
_LEAST_LINE_M = 0.003
"""Least length of a pressed line, [m]. A pressed area that is narrower than this counts as a line."""
_PINCH_HEIGHT_M = 0.006
"""Tips higher than this over the top of the part pinch its upper edge, [m]: denser rays, shorter pressed lines."""
_PINCH_SPACING_M = 0.0005
"""Spacing of the rows of rays for a pinch, [m]."""
_HEIGHT_SLACK_M = 1e-8
"""Slack when heights of tips are compared with their limits, [m]."""
_PERPENDICULAR = 1e-3
"""Largest cosine at which two directions count as perpendicular; 1 minus it: as parallel."""
_PREFERRED_HEIGHT = 0.65
"""Preferred height of the tips above the lowest point of the part, as a fraction of its height."""
_WIDTH_SLACK_M = 0.002
"""Half a held width may be so much less than half the extent of the part and still count as all of it, [m]."""
_LINE_COST_M = 0.003
"""Extra cost of a hold along a line, [m]: a flat hold so much farther from the centre of mass is as good."""


class PadPlace(NamedTuple):
    """A place for the two pads, in the frame of the part, [m]."""

    point: Array
    """The point between the tips, (3,)."""
    across: Array
    """The direction along which the pads close, unit vector, (3,)."""
    half_width: float
    """Half the width of what is held, along `across`."""


def measure_held_span(pieces: tuple[Piece, ...], point: Array, across: Array, up: Array) -> tuple[float, float] | None:
    """Measure the material between two pads that close on a point.

    If the point lies in the gap between two arms of a part, the span reaches from the outside of one arm to the outside
    of the other, since the pads press the arms towards each other.

    Args:
        point: The point between the tips, (3,), frame of the part, [m].
        across: The direction along which the pads close, unit vector, (3,).
        up: The vertical, unit vector, (3,), frame of the part.

    Returns:
        Begin and end of the material along `across`, relative to the point, [m]; None if there is nothing between the
        pads.
    """
    along = np.cross(up, across)
    side, down, up_m = PAD_M
    t = float(point @ along)
    h = float(point @ up)
    columns = list_grid_coordinates(t - side, t + side, _axes_of_cylinders(pieces, along, t - side, t + side))
    rows = list_grid_coordinates(h - down, h + up_m, _axes_of_cylinders(pieces, up, h - down, h + up_m))
    rays = cast_ray_grid(pieces, across, up, columns, rows)
    center = float(point @ across)
    spans = merge_narrow_gaps(rays, np.ones(len(rays.t), dtype=np.bool_))
    begins = [low for low, _ in spans if low < center]
    ends = [high for _, high in spans if high > center]
    return (begins[-1] - center, ends[0] - center) if begins and ends else None


@lru_cache(maxsize=4096)
def measure_held_width(
    pieces: tuple[Piece, ...], point: tuple[float, ...], across: tuple[float, ...], up: tuple[float, ...]
) -> float | None:
    """Half the width of what two pads hold that close on a point, [m]; None if there is nothing between them.

    The arguments are those of `measure_held_span`, as tuples, so that the result can be cached.
    """
    span = measure_held_span(pieces, np.array(point), np.array(across), np.array(up))
    return None if span is None else (span[1] - span[0]) / 2


def holds_whole_width(pieces: tuple[Piece, ...], point: Array, across: Array, up: Array) -> bool:
    """Whether the pads hold the part over its whole width along `across`, not just one arm of it."""
    low, high = measure_extent(pieces, across)
    own = measure_held_width(pieces, tuple(point), tuple(across), tuple(up))
    return own is not None and own > (high - low) / 2 - _WIDTH_SLACK_M


def find_holds(solid: Solid, up: Array, opening_m: float, over_m: float = 0.0) -> tuple[PadPlace, ...]:
    """List the places at which a gripper from above can hold a part, the best first.

    Best means near the centre of mass in the plane, near the preferred height, narrow, and flat rather than along a
    line.

    Args:
        up: The vertical, unit vector, (3,), frame of the part.
        opening_m: Largest travel of each finger from the middle, [m].
        over_m: How far the tips may be above the top of the part, [m]; the pads reach below the tips.
    """
    arguments = solid, tuple(map(float, up)), opening_m, over_m
    if over_m > _PINCH_HEIGHT_M:
        return _search_holds(*arguments, _PINCH_SPACING_M)
    return _search_holds(*arguments, RAY_SPACING_M) or _search_holds(*arguments, _FINE_SPACING_M)


def is_held(solid: Solid, point: Array, across: Array, up: Array, opening_m: float) -> bool:
    """Whether pads that close on a point lie flat on the part, or along a line of a shaft.

    Args:
        point: The point between the tips, (3,), frame of the part, [m].
        across: The direction along which the pads close, unit vector, (3,).
        up: The vertical, unit vector, (3,), frame of the part.
        opening_m: Largest travel of each finger from the middle, [m].
    """
    along = np.cross(up, across)
    t, h, center = (float(point @ axis) for axis in (along, up, across))
    # First exactly the pad, then a margin around it: material just below the pads may join what they hold, or block
    # them, so either answer is accepted.
    for margin in (0.0, RAY_SPACING_M):
        ends = (t - PAD_M[0] - margin, t + PAD_M[0] + margin), (h - PAD_M[1] - margin, h + PAD_M[2])
        columns, rows = (
            list_grid_coordinates(*range_m, [middle, *_axes_of_round_faces(solid, axis, *range_m)], _PINCH_SPACING_M)
            for range_m, middle, axis in zip(ends, (t, h), (along, up), strict=True)
        )
        intervals = _list_holdable_intervals(
            cast_ray_grid(solid.pieces, across, up, columns, rows), t, h, opening_m, _FINE_SPACING_M
        )
        if any(low < center < high for low, high, _ in intervals):
            return True
    return False


def _axes_of_round_faces(solid: Solid, axis: Array, low: float, high: float) -> list[float]:
    """Coordinates along `axis`, between low and high, of the axes of round faces that are perpendicular to it, [m]."""
    places = [float(f.point @ axis) for f in solid.rounds.values() if abs(f.axis @ axis) < _PERPENDICULAR]
    return [x for x in places if low < x < high]


def _axes_of_cylinders(pieces: tuple[Piece, ...], axis: Array, low: float, high: float) -> list[float]:
    """Coordinates along `axis`, between low and high, of the centres of cylinders, [m]."""
    middles = [float(p.cylinder.center @ axis) for p in pieces if isinstance(p, Hull) and p.cylinder is not None]
    return [x for x in middles if low < x < high]


@lru_cache(maxsize=128)
def _search_holds(
    solid: Solid, vertical: tuple[float, ...], opening_m: float, over_m: float, ray_m: float
) -> tuple[PadPlace, ...]:
    """Search the holds for `find_holds`, best first, with rows of rays `ray_m` apart, [m].

    The arguments are hashable, so that the result can be cached: `vertical` is `up`.
    """
    up = np.array(vertical)
    bottom, top = measure_extent(solid.pieces, up)
    # The preferred height, unless the pads would touch the ground or the palm the part there.
    best_height = max(bottom + _PREFERRED_HEIGHT * (top - bottom), bottom + _LEAST_TIP_HEIGHT_M, top - _PALM_HEIGHT_M)
    least_length, step = (
        (_LEAST_LINE_M, RAY_SPACING_M) if over_m <= _PINCH_HEIGHT_M else (_FINE_SPACING_M, _PINCH_SPACING_M)
    )
    heights = list_grid_coordinates(bottom, max(top + over_m, best_height), [best_height], step)
    tips = heights[heights >= max(bottom + _LEAST_TIP_HEIGHT_M, top - _PALM_HEIGHT_M) - _HEIGHT_SLACK_M]
    candidates: list[tuple[float, PadPlace]] = []
    for across in _closing_directions(solid, up):
        along = np.cross(up, across)
        low, high = measure_extent(solid.pieces, along)
        t = list_grid_coordinates(
            low, high, [float(f.point @ along) for f in solid.rounds.values() if abs(f.axis @ up) > 1 - _PERPENDICULAR]
        )
        shaft_heights = [float(f.point @ up) for f in solid.rounds.values() if abs(f.axis @ up) < _PERPENDICULAR]
        rays = cast_ray_grid(solid.pieces, across, up, t, list_grid_coordinates(bottom, top, shaft_heights, ray_m))
        for tip in tips:
            for column in t:
                for low, high, is_line in _list_holdable_intervals(rays, column, tip, opening_m, least_length):
                    point = (low + high) / 2 * across + column * along + tip * up
                    # Cost in metres: level distance from the centre of mass (1-norm), height, width, line contact.
                    distance = np.abs([(point - solid.centroid) @ across, (point - solid.centroid) @ along]).sum()
                    cost = float(distance + 0.5 * abs(tip - best_height) + 0.25 * (high - low) + _LINE_COST_M * is_line)
                    candidates.append((round(cost, 9), PadPlace(point, across, (high - low) / 2)))
    return tuple(hold for _, hold in sorted(candidates, key=lambda each: each[0]))


def _closing_directions(solid: Solid, up: Array) -> Iterator[Array]:
    """Level directions in which the pads may close: across flat faces, and across the walls of shafts.

    A shaft that stands upright could be held in any direction; four directions, 45 degrees apart, stand for all. Each
    direction comes once, whichever its sign.
    """
    candidates = [face.normal for face in solid.faces.values() if abs(face.normal @ up) < _PERPENDICULAR]
    for face in (face for face in solid.rounds.values() if not face.hole and face.kind == "cylinder"):
        if abs(face.axis @ up) > 1.0 - _PERPENDICULAR:
            x, y = (np.asarray(axis - (axis @ up) * up) for axis in find_plane_across(up).T)
            candidates += [x, y, (x + y) / np.sqrt(2.0), (x - y) / np.sqrt(2.0)]
        else:
            candidates.append(np.cross(up, face.axis))
    kept: list[Array] = []
    for direction in candidates:
        direction = direction - (direction @ up) * up
        direction = direction / np.linalg.norm(direction)
        if all(abs(direction @ other) < 1.0 - 1e-6 for other in kept):
            kept.append(direction)
            # Sign convention: the largest component is positive; + 0.0 turns -0 into 0.
            yield np.asarray(direction * np.sign(direction[np.abs(direction).argmax()]) + 0.0)


def _list_holdable_intervals(
    rays: PadRays, t: float, h: float, opening_m: float, least_length: float
) -> Iterator[tuple[float, float, bool]]:
    """Intervals that pads with their tips at (t, h) can hold: (begin, end, line), [m], `line` if touched along one
    only.

    Args:
        opening_m: Largest travel of each finger from the middle, [m].
        least_length: Least length of the pressed area in one of its two directions, [m].
    """
    side, down, up_m = PAD_M
    # Rays at the fingers, from a margin below the pads upwards; those of them at pad height; those on the pad itself.
    at_fingers = (np.abs(rays.t - t) <= side + RAY_SPACING_M) & (rays.h >= h - down - RAY_SPACING_M)
    at_pads = at_fingers & (rays.h <= h + up_m)
    on_pad = ((np.abs(rays.t - t) <= side) & (rays.h >= h - down))[at_pads]
    enter, leave = rays.low[at_pads], rays.high[at_pads]
    for low, high in merge_narrow_gaps(rays, at_pads):
        if (high - low) / 2 + FINGER_CLEARANCE_M / 2 > opening_m or blocks_finger(rays, at_fingers, low, high):
            continue
        # First and last surface of each ray within this interval of material; passages outside count as NaN.
        inside = np.where((enter >= low - 1e-9) & (leave <= high + 1e-9), 1.0, np.nan)
        with np.errstate(invalid="ignore"):
            first = np.fmin.reduce(enter * inside, axis=1)
            last = np.fmax.reduce(leave * inside, axis=1)
            pressed = on_pad & (first < low + _PRESSED_DEPTH_M) & (last > high - _PRESSED_DEPTH_M)
        # Something near the middle of the pad must be pressed, or the part would turn in the grip.
        if (np.abs(rays.t[at_pads][pressed] - t) < side / 3).any():
            lengths = [float(np.ptp(places[at_pads][pressed])) for places in (rays.t, rays.h)]
            if max(lengths) >= least_length:
                yield low, high, min(lengths) < _LEAST_LINE_M
