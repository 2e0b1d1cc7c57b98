"""Where parts stand on the table before they are assembled: in reach, with room for fingers between them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from shapely import MultiPoint, Point

from apo_bench.assembly import Poses
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Hull, Piece, Solid, measure_extent
from apo_bench.scenario.scenario import Site

_LOW_M = 2e-5
"""Corners within this height of the lowest one carry."""
_LEAST_M = 5e-4
_SLOPE = 0.04
"""Margins of a centre of mass inside of the area that carries: a length, and a share of its height."""
_LEVEL = 1e-6
_BASE_M = (-0.42, 0.0)
"""The base of the arm of the package."""
_NEAREST_M = 0.27  # from the base, of what the arm reaches
_FARTHEST_M = 0.66
_LIKED_M = (0.05, 0.27)
"""Parts start as near as possible to this place, on either side."""
_ROOMS_M = (0.055, 0.04, 0.03)
"""Distances between parts, for fingers: the first one that fits."""
_GRID_M = 0.01
_SPREAD_M = (0.04, 0.06)
_LEAST_SPREAD_M = 0.005
_YAW_DEG = 28.0
_YAW_BESIDE_DEG = 8.0
_LARGE_M = (0.13, 0.16)
"""Reaches from the middle of an assembly beyond which the site has the smallest spread, along x and y."""


class Stance(NamedTuple):
    """How a part stands on a level plane."""

    height_m: float
    """Of its frame over the plane."""
    stands: bool
    rolls: bool
    """It lies on a round wall: nothing but friction keeps it in its place."""


def find_stance(solid: Solid, R: Array) -> Stance:
    """Return how a solid with an orientation, (3, 3), stands."""
    up = R[2]
    low = measure_extent(solid.pieces, up)[0]
    base = (np.concatenate([_lowest(piece, up, low) for piece in solid.pieces]) @ R.T)[:, :2]
    middle = R @ solid.centroid
    if is_carried(base, middle, float(middle[2] - low)):
        return Stance(-low, True, False)
    carrier = MultiPoint(base).convex_hull
    at = Point(middle[:2])
    # It rolls if what carries is a line below the middle: a strip of an area that is a hair's breadth times its length.
    area = MultiPoint(base).minimum_rotated_rectangle.buffer(0.0).area if len(base) > 1 else np.inf
    rolls = bool(area <= _LEAST_M * np.ptp(base, axis=0).max() and carrier.distance(at) < _LEAST_M)
    return Stance(-low, rolls, rolls)


def is_carried(base: Array, middle: Array, height_m: float) -> bool:
    """Whether a centre of mass is above the area that carries, (k, 2), with a margin that grows with its height."""
    carrier = MultiPoint(base).convex_hull
    at = Point(middle[:2])
    is_above = carrier.geom_type == "Polygon" and carrier.contains(at)
    return bool(is_above and carrier.exterior.distance(at) >= max(_LEAST_M, _SLOPE * height_m))


def _lowest(piece: Piece, up: Array, low: float) -> Array:
    """The corners of a piece that touch the plane, (k, 3); of a level cylinder the ends of the line that does."""
    corners = piece.corners
    c = piece.cylinder if isinstance(piece, Hull) else None
    if c is not None and abs(c.axis @ up) < _LEVEL:
        corners = c.center - c.radius * up + c.half_length * np.outer([-1.0, 1.0], c.axis)
    return np.asarray(corners[corners @ up < low + _LOW_M])


def choose_site(reach_m: float, is_beside: bool) -> Site:
    """Return a site for an assembly that reaches `reach_m` from its middle.

    Args:
        is_beside: Whether a sub-assembly is put together next to it.
    """
    x, y = np.clip(np.subtract(_LARGE_M, reach_m), _LEAST_SPREAD_M, _SPREAD_M).round(3).tolist()
    yaw = float(np.radians(_YAW_BESIDE_DEG if is_beside else _YAW_DEG))
    if is_beside:
        return Site((0.13, 0.0), (min(x, 0.01), min(y, 0.02)), (-yaw, yaw))
    return Site((0.1, 0.0), (x, y), (-yaw, yaw))


def find_reach(solids: Mapping[str, Solid], poses: Poses, parts: Sequence[str]) -> float:
    """Return how far parts reach from the origin of the table, [m]."""
    boxes = [_box(solids[part], poses[part][:3, :3]) + poses[part][:2, 3] for part in parts]
    return max((float(np.hypot(*np.abs(box).max(axis=0))) for box in boxes), default=0.0)


def stage_parts(
    solids: Mapping[str, Solid], turns: Mapping[str, Array], kept_free: Sequence[tuple[Array, float]]
) -> Mapping[str, Array]:
    """Return where the frame of each part starts, (2,), [m]; the largest part is placed first.

    Args:
        turns: Part -> its orientation, (3, 3).
        kept_free: Discs that must stay free: middle, (2,), and radius.

    Raises:
        InputError: There is no room.
    """
    boxes = {part: _box(solids[part], R) for part, R in turns.items()}
    for room in _ROOMS_M:
        places: dict[str, Array] = {}
        taken: list[tuple[Array, Array]] = []
        for part in sorted(boxes, key=lambda part: -float(np.prod(boxes[part][1] - boxes[part][0]))):
            low, high = boxes[part]
            half = (high - low) / 2
            middle = next((at for at in _grid() if _is_free(at, half, taken, kept_free, room)), None)
            if middle is None:
                break
            taken.append((middle, half))
            places[part] = np.round(middle - (low + high) / 2, 4)
        if len(places) == len(boxes):
            return places
    raise InputError(
        f"there is no room for {len(turns)} parts to wait on the table in reach of the arm; assemble fewer or smaller "
        "parts at once."
    )


def _is_free(
    at: Array,
    half: Array,
    taken: Sequence[tuple[Array, Array]],
    kept_free: Sequence[tuple[Array, float]],
    room: float,
) -> bool:
    """Whether a box with its middle at a place is clear of other boxes, middle and half sizes, and of discs."""
    is_apart = all((np.abs(at - middle) > half + other + room).any() for middle, other in taken)
    # The point of the box that is nearest to the middle of a disc is outside of it.
    return is_apart and all(np.linalg.norm(np.clip(c, at - half, at + half) - c) > r + room for c, r in kept_free)


def _grid() -> Array:
    """Places in reach, (k, 2), the best first."""
    x, y = np.meshgrid(np.arange(-0.2, 0.26, _GRID_M), np.arange(-0.45, 0.451, _GRID_M), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _BASE_M).T)
    places = places[(far > _NEAREST_M) & (far < _FARTHEST_M)]
    cost = np.hypot(places[:, 0] - _LIKED_M[0], np.abs(places[:, 1]) - _LIKED_M[1])
    return np.asarray(places[np.lexsort((places[:, 1], np.round(cost, 6)))])


def _box(solid: Solid, R: Array) -> Array:
    """The box around a turned solid, seen from above: lowest and highest x and y of it, (2, 2), [m]."""
    return np.array([measure_extent(solid.pieces, R[0]), measure_extent(solid.pieces, R[1])]).T
