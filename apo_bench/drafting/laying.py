"""Where parts wait on the table, and where the assembly stands: in reach of the arm, with room for fingers between."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Solid, extent

_BASE_M = (-0.42, 0.0)
"""Where the arm that comes with the benchmark stands; it reaches the table between two distances."""
_NEAREST_M = 0.27
_FARTHEST_M = 0.66
_LIKED_M = (0.05, 0.27)
"""Parts wait as near as can be to here, on either side."""
_ROOMS_M = (0.055, 0.04, 0.03)
"""Between what waits, for fingers: as much as there is."""
_GRID_M = 0.01
_SPREAD_M = (0.04, 0.06)
_LEAST_M = 0.005
_YAW_DEG = 28.0
_LARGE_M = (0.13, 0.16)
"""An assembly that reaches so far from its middle is moved by no more than the least."""


class Site(NamedTuple):
    """Where the assembly stands."""

    center_m: tuple[float, float]
    spread_m: tuple[float, float]
    yaw_deg: float
    """To either side."""


def site_of(reach_m: float, aside: Array | None) -> Site:
    """A place for an assembly that reaches so far from its middle.

    Args:
        aside: (3,), where a sub-assembly is put together, from the middle, [m]; None if there is none.
    """
    spread = tuple(
        round(float(np.clip(large - reach_m, _LEAST_M, most)), 3)
        for large, most in zip(_LARGE_M, _SPREAD_M, strict=True)
    )
    if aside is None:
        return Site((0.1, 0.0), (spread[0], spread[1]), _YAW_DEG)
    return Site((0.13, 0.0), (min(spread[0], 0.01), min(spread[1], 0.02)), 8.0)


def reach_of(solids: Mapping[str, Solid], poses: Poses, parts: Sequence[str]) -> float:
    """How far parts reach from the origin over the table, [m]."""
    found = 0.0
    for part in parts:
        ends = np.array(_spans(solids[part], poses[part][:3, :3])) + poses[part][:2, 3, None]
        found = max(found, float(np.hypot(*np.abs(ends).max(axis=1))))
    return found


def laid_out(
    solids: Mapping[str, Solid], turns: Mapping[str, Array], site: Site, kept_free: Sequence[tuple[Array, float]]
) -> Mapping[str, Array]:
    """Where each part waits, (2,), of its frame, [m], the largest first.

    Args:
        turns: Part -> its orientation, (3, 3).
        kept_free: Discs that must stay free: middle, (2,), and radius.

    Raises:
        InputError: There is no room.
    """
    for room in _ROOMS_M:
        found = _tried(solids, turns, site, kept_free, room)
        if found is not None:
            return found
    raise InputError(
        f"there is no room for {len(turns)} parts to wait on the table in reach of the arm; assemble fewer or smaller "
        "parts at once."
    )


def _tried(
    solids: Mapping[str, Solid],
    turns: Mapping[str, Array],
    site: Site,
    kept_free: Sequence[tuple[Array, float]],
    room: float,
) -> Mapping[str, Array] | None:
    places: dict[str, Array] = {}
    taken = list[tuple[Array, Array]]()
    boxes = {part: tuple(map(np.array, zip(*_spans(solids[part], R), strict=True))) for part, R in turns.items()}
    for part in sorted(turns, key=lambda part: -float(np.prod(boxes[part][1] - boxes[part][0]))):
        low, high = boxes[part]
        for middle in _grid():
            a = middle - (high - low) / 2
            b = middle + (high - low) / 2
            if all(_apart(a, b, *other, room) for other in taken) and all(
                np.linalg.norm(np.clip(c, a, b) - c) > r + room for c, r in kept_free
            ):
                taken.append((a, b))
                places[part] = np.round(middle - (low + high) / 2, 4)
                break
        else:
            return None
    return places


def _grid() -> Array:
    """Places in reach, (k, 2), the best first."""
    x, y = np.meshgrid(np.arange(-0.2, 0.26, _GRID_M), np.arange(-0.45, 0.451, _GRID_M), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _BASE_M).T)
    places = places[(far > _NEAREST_M) & (far < _FARTHEST_M)]
    cost = np.hypot(places[:, 0] - _LIKED_M[0], np.abs(places[:, 1]) - _LIKED_M[1])
    return np.asarray(places[np.lexsort((places[:, 1], np.round(cost, 6)))])


def _apart(a: Array, b: Array, c: Array, d: Array, room: float) -> bool:
    """Whether two boxes, each from one corner to the other, have room between them."""
    return bool(((a > d + room) | (c > b + room)).any())


def _spans(solid: Solid, R: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """From where to where a turned solid reaches along x and y, [m]."""
    return extent(solid.pieces, R[0]), extent(solid.pieces, R[1])
