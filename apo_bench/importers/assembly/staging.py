"""Place parts on the table before assembly: stable, within reach, with room for the fingers between them."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from shapely import MultiPoint, Point

from apo_bench.assembly import Poses
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Hull, Piece, Solid, measure_extent
from apo_bench.scenario.scenario import Site

_LOW_M = 2e-5
"""Corners within this height of the lowest one are in contact with the table."""
_LEAST_M = 5e-4  # smallest distance of the centre of mass from the edge of the support area
_SLOPE = 0.04  # the same, as a share of the height of the centre of mass
"""The larger of `_LEAST_M` and this share is the margin against toppling."""
_LEVEL = 1e-6  # a cylinder's axis is horizontal below this vertical component
_BASE_M = (-0.42, 0.0)
"""Base of the arm in x and y, world."""
_NEAREST_M = 0.27  # inner radius of the reach around the base
FARTHEST_M = (0.66, 0.56, 0.48, 0.42)
"""Outer radii of the reach; of high assemblies a smaller one is used."""
_LIKED_M = (0.05, 0.27)
"""Preferred place of starts in x and |y|; parts start as near to it as possible, at either side."""
_ROOMS_M = (0.055, 0.04, 0.03)
"""Gaps between parts, for fingers; the first gap with which all parts have room is used."""
_GRID_M = 0.01  # step of the candidate places
_SPREAD_M = (0.04, 0.06)  # largest spread of the site along x and y
_LEAST_SPREAD_M = 0.005  # smallest spread of the site
_YAW_DEG = 28.0  # largest yaw of the site
_YAW_BESIDE_DEG = 8.0  # the same next to a sub-assembly
_LARGE_M = (0.13, 0.16)
"""The site's spread along x and y is this less the reach of the assembly, within the limits above."""


class Stance(NamedTuple):
    """How a part stands on a horizontal plane."""

    height_m: float
    """Height of the part's frame above the plane."""
    stands: bool  # without toppling; a round part that may roll stands too
    rolls: bool
    """The part lies on a round wall, and only friction keeps it from rolling."""


def find_stance(solid: Solid, R: Array) -> Stance:
    """Return how a solid stands in an orientation R, (3, 3), world from part."""
    up = R[2]  # world z in the part frame
    low = measure_extent(solid.pieces, up)[0]
    base = (np.concatenate([_find_lowest_corners(piece, up, low) for piece in solid.pieces]) @ R.T)[:, :2]
    middle = R @ solid.centroid
    if is_carried(base, middle, float(middle[2] - low)):
        return Stance(-low, True, False)
    carrier = MultiPoint(base).convex_hull
    at = Point(middle[:2])
    # The part rolls if it rests on a line below its centre of mass: the support area is a strip of negligible width.
    area = MultiPoint(base).minimum_rotated_rectangle.buffer(0.0).area if len(base) > 1 else np.inf
    rolls = bool(area <= _LEAST_M * np.ptp(base, axis=0).max() and carrier.distance(at) < _LEAST_M)
    return Stance(-low, rolls, rolls)


def is_carried(base: Array, middle: Array, height_m: float) -> bool:
    """Whether a part stands stably: its centre of mass is over the support area with a margin.

    Args:
        base: (k, 2), points of support, [m].
        middle: Centre of mass, of which x and y are used.
        height_m: Height of the centre of mass over the support; the margin grows with it.
    """
    carrier = MultiPoint(base).convex_hull
    at = Point(middle[:2])
    is_above = carrier.geom_type == "Polygon" and carrier.contains(at)
    return bool(is_above and carrier.exterior.distance(at) >= max(_LEAST_M, _SLOPE * height_m))


def _find_lowest_corners(piece: Piece, up: Array, low: float) -> Array:
    """Return the corners of a piece on the plane, (k, 3), part frame; of a lying cylinder the ends of its contact line.

    Args:
        up: The vertical in the part frame.
        low: Height of the plane along `up`, [m].
    """
    corners = piece.corners
    c = piece.cylinder if isinstance(piece, Hull) else None
    if c is not None and abs(c.axis @ up) < _LEVEL:
        corners = c.center - c.radius * up + c.half_length * np.outer([-1.0, 1.0], c.axis)
    return np.asarray(corners[corners @ up < low + _LOW_M])


def choose_site(reach_m: float, is_beside: bool) -> Site:
    """Return the region in which trials place an assembly that reaches `reach_m` from its middle.

    Args:
        is_beside: Whether a sub-assembly is put together next to the assembly.
    """
    x, y = np.clip(np.subtract(_LARGE_M, reach_m), _LEAST_SPREAD_M, _SPREAD_M).round(3).tolist()
    yaw = float(np.radians(_YAW_BESIDE_DEG if is_beside else _YAW_DEG))
    if is_beside:  # less room for the assembly then
        return Site((0.13, 0.0), (min(x, 0.01), min(y, 0.02)), (-yaw, yaw))
    return Site((0.1, 0.0), (x, y), (-yaw, yaw))


def find_reach(solids: Mapping[str, Solid], poses: Poses, parts: Sequence[str]) -> float:
    """Return an upper bound of the horizontal distance of any point of the parts from the origin of the table, [m]."""
    boxes = [_bounding_rectangle(solids[part], poses[part][:3, :3]) + poses[part][:2, 3] for part in parts]
    return max((float(np.hypot(*np.abs(box).max(axis=0))) for box in boxes), default=0.0)


def stage_parts(
    solids: Mapping[str, Solid],
    turns: Mapping[str, Array],
    kept_free: Sequence[tuple[Array, float]],
    farthest_m: float = FARTHEST_M[0],
) -> Mapping[str, Array]:
    """Return the start of each part's frame in x and y, (2,), [m]; the largest part is placed first.

    Args:
        turns: Part -> its orientation, (3, 3).
        kept_free: Discs that must stay free, each its centre, (2,), and its radius, [m].
        farthest_m: Largest distance from the base of the arm.

    Raises:
        InputError: There is no room.
    """
    boxes = {part: _bounding_rectangle(solids[part], R) for part, R in turns.items()}
    grid = _list_grid_places(farthest_m)
    for room in _ROOMS_M:
        places: dict[str, Array] = {}
        taken: list[tuple[Array, Array]] = []
        for part in sorted(boxes, key=lambda part: -float(np.prod(boxes[part][1] - boxes[part][0]))):
            low, high = boxes[part]
            half = (high - low) / 2
            middle = next((at for at in grid if _is_free(at, half, taken, kept_free, room)), None)
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
    """Whether a box is clear of other boxes and of discs.

    Args:
        at, half: Middle and half sizes of the box, (2,) each, [m].
        taken: Middle and half sizes of the other boxes.
        kept_free: Centre and radius of the discs.
        room: Least gap, [m].
    """
    is_apart = all((np.abs(at - middle) > half + other + room).any() for middle, other in taken)
    # The distance from a disc is that of the nearest point of the box from the disc's centre.
    return is_apart and all(np.linalg.norm(np.clip(c, at - half, at + half) - c) > r + room for c, r in kept_free)


def _list_grid_places(farthest_m: float) -> Array:
    """Return the candidate places within reach of the arm, (k, 2), the nearest to `_LIKED_M` first."""
    x, y = np.meshgrid(np.arange(-0.2, 0.26, _GRID_M), np.arange(-0.45, 0.451, _GRID_M), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _BASE_M).T)
    places = places[(far > _NEAREST_M) & (far < farthest_m)]
    cost = np.hypot(places[:, 0] - _LIKED_M[0], np.abs(places[:, 1]) - _LIKED_M[1])
    # Ties by y, so that the order is the same on every machine.
    return np.asarray(places[np.lexsort((places[:, 1], np.round(cost, 6)))])


def _bounding_rectangle(solid: Solid, R: Array) -> Array:
    """Return lowest and highest x and y of a turned solid relative to its frame, (2, 2), [m]."""
    return np.array([measure_extent(solid.pieces, R[0]), measure_extent(solid.pieces, R[1])]).T
