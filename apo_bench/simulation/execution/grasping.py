"""Choose from the planned poses where to hold a part, so that the gripper strikes nothing."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Poses
from apo_bench.geometry import (
    Array,
    Piece,
    Solid,
    all_boxes,
    find_holds,
    holds_whole,
    measure_extent,
    measure_held_width,
    measure_intrusion_depths,
    measure_upright_bounds,
)
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Obstacle, list_gripper_boxes, make_obstacle, translate
from apo_bench.simulation.scene import Scene

_STAND_OFF_M = 0.012
"""How far each finger stands off the part before it closes or after it has let go."""
_MARGINS_M = (0.004, 0.003, 0.002)
"""Room around the gripper, as much as there is."""
_GRID_M = 0.003
"""Candidates along a part, and looks along a stroke, are this far apart."""
_SOME = (0, 1, 9, 73, None)
"""So many places are checked in one call."""
_END_M = 0.018
"""No grasp is nearer to the end of a long part: the pads still lie on it."""
_MOST_LEFT_M = 0.1
"""A grip is changed so near to the goal that the part already lies in what it was put into."""
_HEIGHT = 0.65
"""Height of the tip over the part's lowest point, as a part of its height."""
_SQUARE = 1e-12
_UPRIGHT = float(np.cos(np.radians(10.0)))
"""Parts that were seen tilted stand as they stood, up to 10 degrees."""


class RestingPart(NamedTuple):
    """The part at rest, and what stands around it."""

    T: Array
    around: tuple[Obstacle, ...]


class Stroke(NamedTuple):
    """A straight way of the part to `T`."""

    T: Array
    direction: Array
    """Unit vector, (3,), world."""
    travel: float
    around: tuple[Obstacle, ...]


class Grips(NamedTuple):
    """One grasp for a whole stroke, or two with a change of grip `left` before its end."""

    first: Grasp
    left: float | None = None
    second: Grasp | None = None


def list_obstacles(solids: Mapping[str, Solid], poses: Poses, without: Sequence[str]) -> tuple[Obstacle, ...]:
    """Every part but these, where it is estimated to be."""
    return tuple(make_obstacle(solid.pieces, poses[part]) for part, solid in solids.items() if part not in without)


def grasp_at(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart]) -> Grasp:
    """The first grasp at which the open gripper is clear at every place; the preferred one if there is none."""
    solid = scene.scenario.assembly.solids[part]
    if any(_clear(scene.kinematics, solid, [preferred], places, _MARGINS_M[-1])):
        return preferred
    return find_clear_grasp(scene.kinematics, solid, _candidates(scene, solid, places[0].T), places) or preferred


def clear_across(scene: Scene, part: str, across: Array, place: RestingPart) -> Grasp | None:
    """The first grasp that closes along what is level of a direction of the part, either way, or None.

    It is clear open and closed: fingers that close flush with a wall beside the part stem against it.
    """
    up = upwards(place.T)
    level = across - (across @ up) * up  # without its vertical part
    level /= np.linalg.norm(level)
    stays = Stroke(place.T, up, 0.0, place.around)
    solid = scene.scenario.assembly.solids[part]
    able = [grasp for grasp in _candidates(scene, solid, place.T) if abs(grasp.across @ level) > 0.99]
    able = [
        grasp
        for grasp in able
        if _closed_depth(scene.kinematics, solid, grasp, stays, np.zeros(1), _MARGINS_M[-1])[0] <= 0.0
    ]
    return find_clear_grasp(scene.kinematics, solid, able, [place])


def grips_along(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart], stroke: Stroke) -> Grips:
    """The grasp for a stroke; if none is clear all the way, however little, one to begin and one to end with.

    Both are clear at the change of grip, with fingers open, and on their part of the way, with fingers closed.

    Args:
        places: Where else the part is picked up or put down, clear for the grasp that is used there.
    """
    ends = (*places, RestingPart(stroke.T, stroke.around))
    solid = scene.scenario.assembly.solids[part]
    least = _MARGINS_M[-1]
    if any(_clear(scene.kinematics, solid, [preferred], ends, least)) and not _nearest(
        scene.kinematics, solid, preferred, stroke, least
    ):
        return Grips(preferred)
    everything = _candidates(scene, solid, places[0].T)
    if one := find_clear_grasp(scene.kinematics, solid, everything, ends, [stroke]):
        return Grips(one)
    for margin in _MARGINS_M:
        able = [
            (_nearest(scene.kinematics, solid, grasp, stroke, margin), grasp)
            for grasp in _clear(scene.kinematics, solid, everything, places, margin)
        ]
        pair = _pair(scene, solid, stroke, sorted(able, key=lambda pair: -pair[0]), margin)
        if pair is not None:
            return pair
    return Grips(preferred)


def make_tip_frame(grasp: Grasp, T_part: Array) -> Array:
    """The tip in the part's frame, (4, 4): looking down where the part stands like this, or as the grasp says, closing
    along `across`."""
    ahead = T_part[:3, :3].T @ np.array([0.0, 0.0, -1.0]) if grasp.ahead is None else grasp.ahead
    across = grasp.across
    along = float(across @ ahead)
    if abs(along) > _SQUARE:  # of a part that stands tilted
        across = across - along * ahead
        across = across / np.linalg.norm(across)
    return frame(np.column_stack([across, np.cross(ahead, across), ahead]), grasp.point)


def half_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """Half of the width between the fingers of a part that stands at T, [m]: of boxes that of the part, where they hold
    that."""
    up = upwards(T) if grasp.ahead is None else -grasp.ahead
    own = measure_held_width(pieces, tuple(grasp.point), tuple(grasp.across), tuple(up))
    if own is None or (all_boxes(pieces) and holds_whole(pieces, grasp.point, grasp.across, up)):
        low, high = measure_extent(pieces, grasp.across)
        return (high - low) / 2
    return own


def _known_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """As found with the grasp; those of a hundred candidates would take seconds."""
    return half_width(pieces, grasp, T) if grasp.half_width is None else grasp.half_width


def upwards(T: Array) -> Array:
    """The vertical in the frame of a part at T; one of its axes where it is near to it."""
    up = T[2, :3]
    k = int(np.abs(up).argmax())
    return np.asarray(np.sign(up[k]) * np.eye(3)[k] if abs(up[k]) > _UPRIGHT else up)


def _pair(
    scene: Scene, solid: Solid, stroke: Stroke, able: Sequence[tuple[float, Grasp]], margin: float
) -> Grips | None:
    """Begin with a grasp as near to the middle as can be, and end with one that is clear from there on."""
    goal = RestingPart(stroke.T, stroke.around)
    last = list(_clear(scene.kinematics, solid, _candidates(scene, solid, stroke.T), [goal], margin))
    for left, first in able:
        change = RestingPart(translate(stroke.T, stroke.direction, -left), stroke.around)
        if 0.0 < left < _MOST_LEFT_M and any(_clear(scene.kinematics, solid, [first], [change], margin)):
            near = Stroke(stroke.T, stroke.direction, left, stroke.around)
            for second in _clear(scene.kinematics, solid, last, [change], margin):
                if _nearest(scene.kinematics, solid, second, near, margin) == 0.0:
                    return Grips(first, left, second)
    return None


def _candidates(scene: Scene, solid: Solid, T: Array) -> list[Grasp]:
    """Places on the part at T: those of the box around it where they are on a part of boxes, else by its shape."""
    up = upwards(T)
    if all_boxes(solid.pieces):
        around = _around_box(scene, solid, T)
        if around and all(holds_whole(solid.pieces, grasp.point, grasp.across, up) for grasp in around):
            return around
    return [Grasp(*hold) for hold in find_holds(solid, up, scene.arm.opening_m)]


def _around_box(scene: Scene, solid: Solid, T: Array) -> list[Grasp]:
    """Across either level axis of the box around a part, the narrower one first, from the middle outwards."""
    low, high = solid.bounds
    size = high - low
    middle = (high + low) / 2
    up = int(np.abs(T[2, :3]).argmax())
    rise = np.sign(T[2, up]) * (_HEIGHT - 0.5) * size[up] * np.eye(3)[up]
    level = sorted((axis for axis in range(3) if axis != up), key=lambda axis: size[axis])
    grasps = []
    for axis, along in (level, level[::-1]):
        reach = max(0.0, size[along] / 2 - _END_M)
        offsets = np.arange(-reach, reach + 1e-9, _GRID_M) if reach > _GRID_M else np.zeros(1)
        if size[axis] / 2 + _STAND_OFF_M / 2 <= scene.arm.opening_m:
            for offset in sorted(offsets, key=abs):
                grasps.append(Grasp(middle + rise + offset * np.eye(3)[along], np.eye(3)[axis]))
    return grasps


def find_clear_grasp(
    kinematics: Kinematics,
    solid: Solid,
    grasps: Sequence[Grasp],
    places: Sequence[RestingPart],
    strokes: Sequence[Stroke] = (),
) -> Grasp | None:
    """The first of those around which there is most room at every place, and all along strokes, or None."""
    widest, *less = _MARGINS_M
    first = next(_clear(kinematics, solid, grasps, places, widest, strokes), None)
    # What is not clear with the least room is not with more.
    left = [] if first is not None else list(_clear(kinematics, solid, grasps, places, less[-1], strokes))
    margins = less[:-1] if left else ()
    return next(
        (g for m in margins for g in _clear(kinematics, solid, left, places, m, strokes)),
        first or next(iter(left), None),
    )


def _clear(
    kinematics: Kinematics,
    solid: Solid,
    grasps: Sequence[Grasp],
    places: Sequence[RestingPart],
    margin: float,
    strokes: Sequence[Stroke] = (),
) -> Iterator[Grasp]:
    """The grasps at which the open gripper, about to close or having let go, strikes nothing at any place, nor the
    closed one along any stroke.

    They are computed lazily, some at a time, of these those of one direction and width together.
    """
    T = places[0].T

    def kind(grasp: Grasp) -> tuple[float, ...]:
        ahead = () if grasp.ahead is None else map(float, grasp.ahead)
        return (*map(float, grasp.across), round(_known_width(solid.pieces, grasp, T), 6), *ahead)

    for begin, end in pairwise(_SOME):
        some = grasps[begin:end]
        groups: dict[tuple[float, ...], list[int]] = {}
        for k, grasp in enumerate(some):
            groups.setdefault(kind(grasp), []).append(k)
        free = np.ones(len(some), dtype=np.bool_)
        for those in groups.values():
            free[those] = _is_clear(kinematics, solid, [some[k] for k in those], places, margin, strokes)
        yield from (grasp for grasp, is_free in zip(some, free, strict=True) if is_free)


def _is_clear(
    kinematics: Kinematics,
    solid: Solid,
    same: Sequence[Grasp],
    places: Sequence[RestingPart],
    margin: float,
    strokes: Sequence[Stroke],
) -> NDArray[np.bool_]:
    """Which of some grasps of one direction and width are clear, (k,)."""
    width = _known_width(solid.pieces, same[0], places[0].T)
    opening = min(width + _STAND_OFF_M, kinematics.arm.opening_m)
    points = np.array([grasp.point for grasp in same])
    free = np.ones(len(same), dtype=np.bool_)
    # All points at once: the tip has one orientation at a place.
    for place in places:
        R, at = _tips(same[0], points, place.T)
        free &= gripper_depth(kinematics, opening, R, at, place.around, margin) <= 0.0
    for stroke in strokes:
        able = np.flatnonzero(free)
        if len(able) and stroke.travel > 0.0:
            R, at = _tips(same[0], points[able], stroke.T)
            every = (at[:, None] - _lefts(stroke)[:, None] * stroke.direction).reshape(-1, 3)
            depth = gripper_depth(kinematics, width, R, every, stroke.around, margin)
            free[able] = (depth.reshape(len(able), -1) <= 0.0).all(axis=1)
    return free


def _tips(grasp: Grasp, points: Array, T: Array) -> tuple[Array, Array]:
    """The orientation of the tip at a grasp of a part at T, (3, 3), and its places at such grasps of points, (k, 3)."""
    R = (T @ make_tip_frame(replace(grasp, point=np.zeros(3)), T))[:3, :3]
    return R, points @ T[:3, :3].T + T[:3, 3]


def _nearest(kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, margin: float) -> float:
    """How near to its end the closed gripper comes along a stroke before it strikes something, [m]; 0 if it arrives."""
    lefts = _lefts(stroke)
    struck = _closed_depth(kinematics, solid, grasp, stroke, lefts, margin) > 0.0
    return float(lefts[max(0, int(np.argmax(struck)) - 1)]) if struck.any() else 0.0


def _lefts(stroke: Stroke) -> Array:
    """How far it is to the end of a stroke at each look, [m]."""
    return np.linspace(stroke.travel, 0.0, max(2, round(stroke.travel / _GRID_M) + 1))


def _closed_depth(
    kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, lefts: Array, margin: float
) -> Array:
    """How deep the gripper, closed on the part, is in what stands around, so far before the end of a stroke, (k,)."""
    width = _known_width(solid.pieces, grasp, stroke.T)
    tip = stroke.T @ make_tip_frame(grasp, stroke.T)
    at = tip[:3, 3] - lefts[:, None] * stroke.direction
    return gripper_depth(kinematics, width, tip[:3, :3], at, stroke.around, margin)


def gripper_depth(
    kinematics: Kinematics, opening: float, R: Array, at: Array, around: Sequence[Obstacle], margin: float
) -> Array:
    """How deep the gripper is in what stands around, (k,), [m]: one orientation of the tip, k places (k, 3), world.

    What its way does not come by counts as far away.
    """
    boxes = list_gripper_boxes(kinematics, opening, margin)
    low, high = measure_upright_bounds(boxes, R, np.zeros(3))
    low = low + at.min(axis=0)
    high = high + at.max(axis=0)
    depth = np.full(len(at), -1.0)
    for each in around:
        if (low < each.high).all() and (high > each.low).all():
            depth = np.maximum(depth, measure_intrusion_depths(boxes, R, at, each.pieces, each.T, 0.0))
    return depth
