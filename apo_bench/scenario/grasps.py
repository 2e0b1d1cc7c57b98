"""Where a gripper from above holds the part of an operation: as the file says, or where its shape offers a place."""

from collections.abc import Mapping

import numpy as np

from apo_bench.geometry import FINGER_ROOM_M, PAD_M, Array, Solid, all_boxes, angle_between, extent, holds, holds_whole
from apo_bench.io import JsonNode
from apo_bench.scenario.contacts import read_unit_axis, refuse
from apo_bench.scenario.scenario import Grasp

_RAISED = 0.15
"""Height of a grasp over the middle of the part, as a part of the height of the part."""
_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_MOST_HELD_M = 2 * _OPENING_M - FINGER_ROOM_M
"""Width that the arm can hold where the file does not say how: so much room its fingers want before they close."""
MOST_TILT_DEG = 45.0
"""A hand is tilted by no more."""
_LEVEL = 1e-6
"""Vertical component below which a unit vector is level."""


def read_grasp(node: JsonNode | None, entry: JsonNode, solid: Solid, before: Array) -> Grasp:
    """The grasp; unless the file says otherwise, above the middle, across the narrower level axis of a part of boxes.

    Where that leaves pads beside the part, and of other parts, it is the best place that the shape offers.
    """
    keys = node.fields((), ("at_mm", "across", "ahead")) if node else {}
    low, high = solid.bounds
    level = [axis for axis in range(3) if abs(before[2, axis]) < _LEVEL]
    across = None
    point = _above_middle(solid, before)
    if "ahead" in keys:
        return _tilted(keys, solid, before)
    if "at_mm" in keys:
        point = 1e-3 * keys["at_mm"].numbers(3)
        over = PAD_M[1] * np.round(before[2, :3], 9)
        ends = np.minimum(low, low + over), np.maximum(high, high + over)
        if ((point < ends[0]) | (point > ends[1])).any():
            span = " to ".join("(" + ", ".join(f"{1e3 * x:g}" for x in corner) + ")" for corner in ends)
            needed = f"a point of the part, or up to {1e3 * PAD_M[1]:g} mm over it, from {span} mm, is needed"
            keys["at_mm"].fail(needed, "pads reach so far below the point")
    if "across" in keys:
        across = read_unit_axis(keys["across"])
        keys["across"].require(
            abs((before[:3, :3] @ across)[2]) <= _LEVEL,
            "an axis that is level where the part is picked is needed",
            "the gripper comes from above",
        )
    elif len(level) >= 2:
        across = np.eye(3)[min(level, key=lambda axis: (high - low)[axis])]
    stated = Grasp(point, across) if across is not None else None
    if stated and (keys.keys() == {"at_mm", "across"} or _holds_box(solid, stated, before)):
        ends = extent(solid.pieces, stated.across)
        if keys or ends[1] - ends[0] <= _MOST_HELD_M or not holds(solid, np.round(before[2, :3], 9), _OPENING_M):
            return stated
    return _by_shape(keys, entry, solid, before, point)


def _tilted(keys: Mapping[str, JsonNode], solid: Solid, before: Array) -> Grasp:
    """A grasp of which the file says all, with fingers that point along `ahead`."""
    ahead = read_unit_axis(keys["ahead"])
    across = read_unit_axis(keys["across"]) if "across" in keys else ahead
    keys["ahead"].require(
        "at_mm" in keys and abs(ahead @ across) <= _LEVEL,
        "'at_mm' and an axis 'across' that is square to it are needed",
        "the fingers point along 'ahead' and close along 'across'",
    )
    tilt = float(np.degrees(angle_between(-before[2, :3], ahead)))
    keys["ahead"].require(
        tilt <= MOST_TILT_DEG + _LEVEL,
        f"an axis within {MOST_TILT_DEG:g} degrees of straight down is needed where the part is picked",
    )
    point = 1e-3 * keys["at_mm"].numbers(3)
    for axis, over in ((across, 0.0), (np.cross(ahead, across), 0.0), (-ahead, PAD_M[1])):
        low, high = extent(solid.pieces, axis)
        inside = low - _LEVEL <= point @ axis <= high + over + _LEVEL
        keys["at_mm"].require(inside, f"a point beside the part, or up to {1e3 * over:g} mm before it, is needed")
    return Grasp(point, across, ahead=ahead)


def _holds_box(solid: Solid, grasp: Grasp, T: Array) -> bool:
    """Whether this is a grasp of a part of boxes, with the part between the pads."""
    return all_boxes(solid.pieces) and holds_whole(solid.pieces, grasp.point, grasp.across, np.round(T[2, :3], 9))


def _by_shape(keys: Mapping[str, JsonNode], entry: JsonNode, solid: Solid, T: Array, point: Array) -> Grasp:
    """The best place for pads; of those that are near to what is stated, if something is."""
    grasps = [Grasp(hold.point, hold.across) for hold in holds(solid, np.round(T[2, :3], 9), _OPENING_M)]
    if "across" in keys:
        across = read_unit_axis(keys["across"])
        grasps = [grasp for grasp in grasps if abs(grasp.across @ across) > 1.0 - _LEVEL]
    if not grasps:
        size = " x ".join(f"{round(1e3 * x, 1):g}" for x in solid.bounds[1] - solid.bounds[0])
        refuse(
            entry,
            f"'{entry.value['move']}', {size} mm, has no opposite faces, and no shaft, within {1e3 * _MOST_HELD_M:g} "
            f"mm of each other that pads from above reach; the gripper opens to {2e3 * _OPENING_M:g} mm, so say "
            "grasp = { at_mm = [x, y, z], across = [x, y, z] }, give it something to hold, or let it stand otherwise",
        )
    if "at_mm" in keys:
        return Grasp(point, min(grasps, key=lambda grasp: float(np.linalg.norm(grasp.point - point))).across)
    return grasps[0]


def _above_middle(solid: Solid, T: Array) -> Array:
    """Over the middle of the part as it stands, so that fingers which reach below it clear what it stands on."""
    low, high = solid.bounds
    up = T[2, :3]
    point: Array = (low + high) / 2 + _RAISED * (np.abs(up) @ (high - low)) * up
    return np.clip(point, low, high)
