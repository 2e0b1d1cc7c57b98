"""Rays through a part between two pads: a grid of parallel level rays, and the material along it.

Axes and coordinates are those of `pads`: `up`, `across`, along which the rays go, and `along` = up x across.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.convex import collect_corners, intersect_rays
from apo_bench.geometry.solid import Piece

_FINGER_THICKNESS_M = 0.012
"""Thickness of a finger along the closing direction, [m]."""
FINGER_CLEARANCE_M = 0.012
"""Free width that a finger needs next to the held surface, beyond its own thickness, to come down and open, [m]."""
RAY_SPACING_M = 0.003
"""Spacing of the rays, [m]."""
_ROUNDING_M = 1e-6
"""Slack when rays are matched to the extent of a piece, [m]."""


class PadRays(NamedTuple):
    """A grid of r parallel level rays, and the intervals along each in which it passes through pieces, [m]."""

    t: Array
    """Coordinate of each ray along up x across, (r,)."""
    h: Array
    """Height of each ray, (r,)."""
    low: Array
    """Coordinates along the ray at which it enters pieces, ascending, (r, m); padded with inf."""
    high: Array
    """Coordinates at which it leaves the same pieces, (r, m); padded with -inf."""


def list_grid_coordinates(low: float, high: float, also: Sequence[float], ray_m: float = RAY_SPACING_M) -> Array:
    """Coordinates of grid lines from just inside `low` to just inside `high`, sorted, (k,), [m].

    Args:
        also: Further coordinates to include, such as those of axes of shafts.
        ray_m: Largest spacing; there are at least nine lines, and one of them is the middle.
    """
    middle = (low + high) / 2
    reach = (high - low) / 2 - 1e-6
    n = max(4, int(np.ceil(reach / ray_m)))
    return np.unique(np.round(np.append(middle + np.linspace(-reach, reach, 2 * n + 1), also), 9))


def cast_ray_grid(pieces: tuple[Piece, ...], across: Array, up: Array, t: Array, h: Array) -> PadRays:
    """Cast a grid of rays along `across` through the pieces.

    Args:
        t, h: Coordinates of the columns and rows of the grid, ascending, [m].
    """
    along = np.cross(up, across)
    corners, first = collect_corners(pieces)
    (t0, t1), (h0, h1) = (
        _grid_range_of_pieces(places, corners @ axis, first) for places, axis in ((t, along), (h, up))
    )
    hit_pieces = np.flatnonzero((t0 < t1) & (h0 < h1))  # pieces that at least one ray can hit
    T, H = np.meshgrid(t, h)
    start = T[..., None] * along + H[..., None] * up
    number = np.arange(T.size).reshape(T.shape)
    rays, lows, highs = [np.zeros(0, dtype=np.intp)], [np.zeros(0)], [np.zeros(0)]
    for i in hit_pieces:
        window = slice(h0[i], h1[i]), slice(t0[i], t1[i])
        enter, leave = intersect_rays(pieces[i].planes, start[window].reshape(-1, 3), across)
        hit = np.isfinite(enter)
        rays.append(number[window].ravel()[hit])
        lows.append(enter[hit])
        highs.append(leave[hit])
    # Pack the passages of each ray into the first columns of its row: most rays pass through few of many pieces.
    ray, low, high = (np.concatenate(each) for each in (rays, lows, highs))
    by_entry = np.lexsort((low, ray))
    ray = ray[by_entry]
    passage = np.arange(len(ray)) - np.searchsorted(ray, ray)  # number of a passage within its ray
    ends = [np.full((T.size, int(passage.max(initial=0)) + 1), empty) for empty in (np.inf, -np.inf)]
    for end, values in zip(ends, (low, high), strict=True):
        end[ray, passage] = values[by_entry]
    return PadRays(T.ravel(), H.ravel(), *ends)


def _grid_range_of_pieces(
    grid: Array, coordinates: Array, first_corner: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """For each piece, the range of grid coordinates inside its extent on an axis.

    Args:
        grid: Grid coordinates, ascending, [m].
        coordinates: Coordinates of the corners of all pieces on the axis, piece by piece, [m].
        first_corner: Index of the first corner of each piece.

    Returns:
        Index of the first grid coordinate of each piece, and the index after its last.
    """
    low = np.searchsorted(grid, np.minimum.reduceat(coordinates, first_corner) - _ROUNDING_M)
    return low, np.searchsorted(grid, np.maximum.reduceat(coordinates, first_corner) + _ROUNDING_M)


def merge_narrow_gaps(rays: PadRays, within: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Intervals of material along the rays, (begin, end), ascending, [m]; gaps too narrow for a finger are closed.

    Args:
        within: The rays to consider, (r,).
    """
    low = rays.low[within]
    high = rays.high[within]
    is_hit = np.isfinite(low)
    if not is_hit.any():
        return []
    order = np.argsort(low[is_hit])
    low = low[is_hit][order]
    farthest = np.maximum.accumulate(high[is_hit][order])
    # A finger fits into a gap that is wider than the finger and its distance from the surface.
    is_gap = low[1:] >= farthest[:-1] + _FINGER_THICKNESS_M + FINGER_CLEARANCE_M
    begins = np.append(low[0], low[1:][is_gap])
    ends = np.append(farthest[:-1][is_gap], farthest[-1])
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def blocks_finger(rays: PadRays, at_fingers: NDArray[np.bool_], low: float, high: float) -> bool:
    """Whether the part itself blocks a finger next to the held interval, either open or on its way down.

    Args:
        at_fingers: The rays at the fingers and above them, (r,).
        low, high: The held interval along the rays, [m].
    """
    needed = _FINGER_THICKNESS_M + FINGER_CLEARANCE_M
    sides = (low - needed, low - 1e-6), (high + 1e-6, high + needed)
    return any(bool(((rays.low[at_fingers] < end) & (rays.high[at_fingers] > begin)).any()) for begin, end in sides)
