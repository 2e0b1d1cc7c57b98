"""Choose the grasp of a part: as the scenario file states it, or found from the shape of the part."""

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import (
    FINGER_CLEARANCE_M,
    PAD_M,
    Array,
    Solid,
    all_boxes,
    find_holds,
    holds_whole_width,
    measure_angle,
    measure_extent,
)
from apo_bench.scenario.scenario import Grasp
from apo_bench.scenario.tables import GraspTable
from apo_bench.scenario.values import normalize_axis

_RAISED_M = 0.15
"""Height of a default grasp above the middle of the part, as a fraction of the height of the part."""
_OPENING_M = 0.046
"""Largest opening of each finger of the default arm."""
_MOST_HELD_M = 2 * _OPENING_M - FINGER_CLEARANCE_M
"""Largest width of a part for a default grasp; open fingers need `FINGER_CLEARANCE_M` of free space."""
MOST_TILT_DEG = 45.0
"""Largest tilt of the gripper from straight down."""
_LEVEL = 1e-6
"""A unit vector is horizontal if its vertical component is smaller."""


def read_grasp(stated: GraspTable, place: str, part: str, solid: Solid, before: Array) -> Grasp:
    """Read a grasp, and fill in what the file does not state.

    The default for a part of boxes is above the middle, across the narrower horizontal axis. If the pads would miss the
    part there, and for other parts, the default is the best place that the shape offers.

    Args:
        stated: The `grasp` table.
        place: File and key, for messages.
        part: Name of the part.
        before: (4, 4), pose of the part when it is picked.
    """
    if stated.ahead is not None:
        return _read_tilted_grasp(stated, place, solid, before)
    point = _find_point_above_middle(solid, before) if stated.at_mm is None else 1e-3 * np.array(stated.at_mm)
    across = None if stated.across is None else normalize_axis(stated.across, f"{place}, across")
    if stated.at_mm is not None:
        _check_within_reach(point, f"{place}, at_mm", solid, before)
    if across is not None:
        level = abs((before[:3, :3] @ across)[2]) <= _LEVEL
        require(level, f"{place}, across: an axis that is level where the part is picked is needed.")
    grasp = _complete_box_grasp(point, across, solid, before)
    complete = stated.at_mm is not None and across is not None
    if grasp and (complete or _holds_box(solid, grasp, before)):
        ends = measure_extent(solid.pieces, grasp.across)
        narrow = ends[1] - ends[0] <= _MOST_HELD_M
        if stated != GraspTable() or narrow or not find_holds(solid, np.round(before[2, :3], 9), _OPENING_M):
            return grasp
    return _find_grasp_by_shape(stated, across, place, part, solid, before)


def _complete_box_grasp(point: Array, across: Array | None, solid: Solid, before: Array) -> Grasp | None:
    """The grasp at a point across the stated axis, else across the narrower horizontal axis of the part.

    None if no axis is stated and the part has fewer than two horizontal axes.
    """
    level = [axis for axis in range(3) if abs(before[2, axis]) < _LEVEL]
    low, high = solid.bounds
    if across is None and len(level) >= 2:
        across = np.eye(3)[min(level, key=lambda axis: (high - low)[axis])]
    return None if across is None else Grasp(point, across)


def _check_within_reach(point: Array, place: str, solid: Solid, before: Array) -> None:
    """Raise an `InputError` unless a point is in the bounding box of the part, or above by at most the pad height."""
    low, high = solid.bounds
    over = PAD_M[1] * np.round(before[2, :3], 9)
    ends = np.minimum(low, low + over), np.maximum(high, high + over)
    if ((point < ends[0]) | (point > ends[1])).any():
        span = " to ".join("(" + ", ".join(f"{1e3 * x:g}" for x in corner) + ")" for corner in ends)
        raise InputError(f"{place}: a point of the part, or up to {1e3 * PAD_M[1]:g} mm over it, is needed: {span} mm.")


def _read_tilted_grasp(stated: GraspTable, place: str, solid: Solid, before: Array) -> Grasp:
    """A tilted grasp, with fingers that point along `ahead`; the file must state all of it."""
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
    # The point must be in the part's extent along each axis of the hand; against `ahead` it may exceed it.
    for axis, over in ((across, 0.0), (np.cross(ahead, across), 0.0), (-ahead, PAD_M[1])):
        low, high = measure_extent(solid.pieces, axis)
        inside = low - _LEVEL <= point @ axis <= high + over + _LEVEL
        require(inside, f"{place}, at_mm: a point of the part, or up to {1e3 * over:g} mm before it, is needed.")
    return Grasp(point, across, ahead=ahead)


def _holds_box(solid: Solid, grasp: Grasp, T: Array) -> bool:
    """True if the part consists of boxes and lies between the pads; T is its pose (4, 4) when it is picked."""
    return all_boxes(solid.pieces) and holds_whole_width(solid.pieces, grasp.point, grasp.across, np.round(T[2, :3], 9))


def _find_grasp_by_shape(
    stated: GraspTable, across: Array | None, place: str, part: str, solid: Solid, T: Array
) -> Grasp:
    """The best grasp that the shape offers, across the stated axis if there is one.

    With a stated point the grasp is at that point, across the axis of the nearest grasp of the shape.
    """
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


def _find_point_above_middle(solid: Solid, T: Array) -> Array:
    """A point (3,) above the middle of the part, frame of the part, so that fingertips clear the ground below it."""
    low, high = solid.bounds
    up = T[2, :3]
    point: Array = (low + high) / 2 + _RAISED_M * (np.abs(up) @ (high - low)) * up
    return np.clip(point, low, high)
