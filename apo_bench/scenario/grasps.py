"""Grasps of parts: as a scenario file states them, or where the shape of a part offers one."""

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import (
    FINGER_ROOM_M,
    PAD_M,
    Array,
    Solid,
    all_boxes,
    find_holds,
    holds_whole,
    measure_angle,
    measure_extent,
)
from apo_bench.scenario.scenario import Grasp
from apo_bench.scenario.tables import GraspTable
from apo_bench.scenario.values import normalize_axis

_RAISED = 0.15
"""Height of a grasp over the middle of the part, as a part of the height of the part."""
_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_MOST_HELD_M = 2 * _OPENING_M - FINGER_ROOM_M
"""Width that the arm can hold where the file does not say how: so much space its fingers need before they close."""
MOST_TILT_DEG = 45.0
"""A hand is tilted by no more."""
_LEVEL = 1e-6
"""Vertical component below which a unit vector is level."""


def read_grasp(stated: GraspTable, place: str, part: str, solid: Solid, before: Array) -> Grasp:
    """The grasp; unless the file says otherwise, above the middle, across the narrower level axis of a part of boxes.

    Where that leaves pads off the part, and of other parts, it is the best place that the shape offers.

    Args:
        place: File and key, for messages.
        part: Name of the part.
        before: Where it stands when it is picked, (4, 4).
    """
    if stated.ahead is not None:
        return _tilted(stated, place, solid, before)
    point = _above_middle(solid, before) if stated.at_mm is None else 1e-3 * np.array(stated.at_mm)
    across = None if stated.across is None else normalize_axis(stated.across, f"{place}, across")
    if stated.at_mm is not None:
        _check_within_reach(point, f"{place}, at_mm", solid, before)
    if across is not None:
        level = abs((before[:3, :3] @ across)[2]) <= _LEVEL
        require(level, f"{place}, across: an axis that is level where the part is picked is needed.")
    grasp = _across_boxes(point, across, solid, before)
    complete = stated.at_mm is not None and across is not None
    if grasp and (complete or _holds_box(solid, grasp, before)):
        ends = measure_extent(solid.pieces, grasp.across)
        narrow = ends[1] - ends[0] <= _MOST_HELD_M
        if stated != GraspTable() or narrow or not find_holds(solid, np.round(before[2, :3], 9), _OPENING_M):
            return grasp
    return _by_shape(stated, across, place, part, solid, before)


def _across_boxes(point: Array, across: Array | None, solid: Solid, before: Array) -> Grasp | None:
    """Across what is stated, else across the narrower level axis; None if there are not two."""
    level = [axis for axis in range(3) if abs(before[2, axis]) < _LEVEL]
    low, high = solid.bounds
    if across is None and len(level) >= 2:
        across = np.eye(3)[min(level, key=lambda axis: (high - low)[axis])]
    return None if across is None else Grasp(point, across)


def _check_within_reach(point: Array, place: str, solid: Solid, before: Array) -> None:
    """A point is in the box around a part, or so far over it as pads reach down."""
    low, high = solid.bounds
    over = PAD_M[1] * np.round(before[2, :3], 9)
    ends = np.minimum(low, low + over), np.maximum(high, high + over)
    if ((point < ends[0]) | (point > ends[1])).any():
        span = " to ".join("(" + ", ".join(f"{1e3 * x:g}" for x in corner) + ")" for corner in ends)
        raise InputError(f"{place}: a point of the part, or up to {1e3 * PAD_M[1]:g} mm over it, is needed: {span} mm.")


def _tilted(stated: GraspTable, place: str, solid: Solid, before: Array) -> Grasp:
    """A grasp of which the file says all, with fingers that point along `ahead`."""
    if stated.at_mm is None or stated.across is None or stated.ahead is None:
        raise InputError(f"{place}, ahead: 'at_mm' and an axis 'across' are needed with it.")
    ahead = normalize_axis(stated.ahead, f"{place}, ahead")
    across = normalize_axis(stated.across, f"{place}, across")
    require(abs(ahead @ across) <= _LEVEL, f"{place}, ahead: an axis that is square to 'across' is needed.")
    tilt = float(np.degrees(measure_angle(-before[2, :3], ahead)))
    require(
        tilt <= MOST_TILT_DEG + _LEVEL,
        f"{place}, ahead: an axis within {MOST_TILT_DEG:g} degrees of straight down is needed, {tilt:.3g} are given.",
    )
    point = 1e-3 * np.array(stated.at_mm)
    for axis, over in ((across, 0.0), (np.cross(ahead, across), 0.0), (-ahead, PAD_M[1])):
        low, high = measure_extent(solid.pieces, axis)
        inside = low - _LEVEL <= point @ axis <= high + over + _LEVEL
        require(inside, f"{place}, at_mm: a point of the part, or up to {1e3 * over:g} mm before it, is needed.")
    return Grasp(point, across, ahead=ahead)


def _holds_box(solid: Solid, grasp: Grasp, T: Array) -> bool:
    """Whether this is a grasp of a part of boxes, with the part between the pads."""
    return all_boxes(solid.pieces) and holds_whole(solid.pieces, grasp.point, grasp.across, np.round(T[2, :3], 9))


def _by_shape(stated: GraspTable, across: Array | None, place: str, part: str, solid: Solid, T: Array) -> Grasp:
    """The best place for pads; of those that are near to what is stated, if something is."""
    grasps = [Grasp(hold.point, hold.across) for hold in find_holds(solid, np.round(T[2, :3], 9), _OPENING_M)]
    if across is not None:
        grasps = [grasp for grasp in grasps if abs(grasp.across @ across) > 1.0 - _LEVEL]
    size = " x ".join(f"{round(1e3 * x, 1):g}" for x in solid.bounds[1] - solid.bounds[0])
    require(
        grasps,
        f"{place}: '{part}', {size} mm, has no opposite faces, and no shaft, within {1e3 * _MOST_HELD_M:g} mm of each "
        "other that pads from above reach; say at_mm and across, or let it stand otherwise.",
    )
    if stated.at_mm is None:
        return grasps[0]
    point = 1e-3 * np.array(stated.at_mm)
    return Grasp(point, min(grasps, key=lambda grasp: float(np.linalg.norm(grasp.point - point))).across)


def _above_middle(solid: Solid, T: Array) -> Array:
    """Over the middle of the part as it stands, so that fingers which reach below it clear what it stands on."""
    low, high = solid.bounds
    up = T[2, :3]
    point: Array = (low + high) / 2 + _RAISED * (np.abs(up) @ (high - low)) * up
    return np.clip(point, low, high)
