"""Choose the grasp of a part from planned poses, so that the gripper collides with nothing."""

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
    holds_whole_width,
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
"""Distance of each finger from the part before it closes or after it has opened."""
_MARGINS_M = (0.004, 0.003, 0.002)
"""Room required around the gripper; the first value for which there is a grasp is used."""
_GRID_M = 0.003
"""Spacing of candidate grasps along a part, and of the places checked along a stroke."""
_SOME = (0, 1, 9, 73, None)
"""Bounds of the batches in which candidates are checked: the first alone, since it is often clear."""
_END_M = 0.018
"""Least distance of a grasp from the end of a long part, so that the whole pads lie on it."""
_MOST_LEFT_M = 0.1
"""Greatest distance to the goal at a change of grip, so that the part already lies in its hole or slot."""
_HEIGHT = 0.65
"""Height of the grasp over the part's lowest point, as a fraction of the part's height."""
_SQUARE = 1e-12  # cosine above which two directions are not taken as perpendicular
_UPRIGHT = float(np.cos(np.radians(10.0)))
"""A part whose axis is observed within 10 degrees of the vertical is taken as upright."""


class RestingPart(NamedTuple):
    """The part at rest, and the parts around it."""

    T: Array
    """Pose of the part, (4, 4), world."""
    around: tuple[Obstacle, ...]


class Stroke(NamedTuple):
    """A straight motion of the part that ends at `T`."""

    T: Array
    """Pose of the part, (4, 4), world."""
    direction: Array
    """Unit vector, (3,), world."""
    travel: float
    """Length of the motion, [m]."""
    around: tuple[Obstacle, ...]


class Grips(NamedTuple):
    """One grasp for a whole stroke, or two with a change of grip `left`, [m], before its end."""

    first: Grasp
    left: float | None = None
    second: Grasp | None = None


def list_obstacles(solids: Mapping[str, Solid], poses: Poses, without: Sequence[str]) -> tuple[Obstacle, ...]:
    """Return all parts except those in `without` as obstacles at the given poses."""
    return tuple(make_obstacle(solid.pieces, poses[part]) for part, solid in solids.items() if part not in without)


def grasp_at(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart]) -> Grasp:
    """Return the preferred grasp if the open gripper is clear at every place, else the first candidate that is.

    If none is clear, the preferred one is returned.
    """
    solid = scene.scenario.assembly.solids[part]
    if any(_clear(scene.kinematics, solid, [preferred], places, _MARGINS_M[-1])):
        return preferred
    return find_clear_grasp(scene.kinematics, solid, _candidates(scene, solid, places[0].T), places) or preferred


def clear_across(scene: Scene, part: str, across: Array, place: RestingPart) -> Grasp | None:
    """Return the first clear grasp that closes along the level component of a direction, or None.

    It is clear open and closed, since fingers that close flush with a wall next to the part jam against it.

    Args:
        across: Direction in the frame of the part, (3,); its sign does not matter.
    """
    up = upwards(place.T)
    level = across - (across @ up) * up  # without its vertical part
    level /= np.linalg.norm(level)
    stays = Stroke(place.T, up, 0.0, place.around)  # of length zero, to check the closed gripper
    solid = scene.scenario.assembly.solids[part]
    able = [grasp for grasp in _candidates(scene, solid, place.T) if abs(grasp.across @ level) > 0.99]
    able = [
        grasp
        for grasp in able
        if _closed_depth(scene.kinematics, solid, grasp, stays, np.zeros(1), _MARGINS_M[-1])[0] <= 0.0
    ]
    return find_clear_grasp(scene.kinematics, solid, able, [place])


def grips_along(scene: Scene, part: str, preferred: Grasp, places: Sequence[RestingPart], stroke: Stroke) -> Grips:
    """Return one grasp that is clear along a whole stroke, else two with a change of grip on the way.

    Of two, each is clear with closed fingers on its part of the stroke, and both with open fingers at the change. The
    preferred grasp is tried first, and returned if nothing is clear.

    Args:
        places: Further places at which the part is picked up or put down, before the stroke.
        stroke: A straight motion to the goal; the part can also be pulled out backwards along it.
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
    """Return the pose of the tip in the frame of the part, (4, 4).

    Its z axis points down for a part at `T_part`, or along `grasp.ahead`; its x axis, the closing direction, is
    `grasp.across`.
    """
    ahead = T_part[:3, :3].T @ np.array([0.0, 0.0, -1.0]) if grasp.ahead is None else grasp.ahead
    across = grasp.across
    along = float(across @ ahead)
    if abs(along) > _SQUARE:  # the part is tilted: make the closing direction perpendicular to the z axis
        across = across - along * ahead
        across = across / np.linalg.norm(across)
    return frame(np.column_stack([across, np.cross(ahead, across), ahead]), grasp.point)


def half_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """Return half the width of the part between the fingers, [m].

    For a part of boxes whose full width the fingers hold, this is half the extent of the part. The same extent is used
    if the width at the grasp cannot be measured.

    Args:
        T: Pose of the part, (4, 4), from which a grasp without `ahead` has its vertical.
    """
    up = upwards(T) if grasp.ahead is None else -grasp.ahead
    own = measure_held_width(pieces, tuple(grasp.point), tuple(grasp.across), tuple(up))
    if own is None or (all_boxes(pieces) and holds_whole_width(pieces, grasp.point, grasp.across, up)):
        low, high = measure_extent(pieces, grasp.across)
        return (high - low) / 2
    return own


def _known_width(pieces: tuple[Piece, ...], grasp: Grasp, T: Array) -> float:
    """Return the half width stored with the grasp, computed only if it is missing, since that is slow."""
    return half_width(pieces, grasp, T) if grasp.half_width is None else grasp.half_width


def upwards(T: Array) -> Array:
    """Return the vertical in the frame of a part at T, (3,), rounded to an axis within 10 degrees of it."""
    up = T[2, :3]
    k = int(np.abs(up).argmax())
    return np.asarray(np.sign(up[k]) * np.eye(3)[k] if abs(up[k]) > _UPRIGHT else up)


def _pair(
    scene: Scene, solid: Solid, stroke: Stroke, able: Sequence[tuple[float, Grasp]], margin: float
) -> Grips | None:
    """Return the first pair of grasps with a change of grip on the way, or None.

    Args:
        able: First grasps, each with the distance from the end at which the gripper collides, [m], best first.
        margin: Room around the gripper, [m].
    """
    goal = RestingPart(stroke.T, stroke.around)
    last = list(_clear(scene.kinematics, solid, _candidates(scene, solid, stroke.T), [goal], margin))
    for left, first in able:
        change = RestingPart(translate(stroke.T, stroke.direction, -left), stroke.around)
        # The change happens where the first grasp must stop, if the open gripper is clear there.
        if 0.0 < left < _MOST_LEFT_M and any(_clear(scene.kinematics, solid, [first], [change], margin)):
            near = Stroke(stroke.T, stroke.direction, left, stroke.around)
            for second in _clear(scene.kinematics, solid, last, [change], margin):
                if _nearest(scene.kinematics, solid, second, near, margin) == 0.0:
                    return Grips(first, left, second)
    return None


def _candidates(scene: Scene, solid: Solid, T: Array) -> list[Grasp]:
    """Return candidate grasps of a part at T, best first.

    They lie on the bounding box if the part consists of boxes and all of them hold its full width. Else they are found
    from the shape.
    """
    up = upwards(T)
    if all_boxes(solid.pieces):
        around = _around_box(scene, solid, T)
        if around and all(holds_whole_width(solid.pieces, grasp.point, grasp.across, up) for grasp in around):
            return around
    return [Grasp(*hold) for hold in find_holds(solid, up, scene.arm.opening_m)]


def _around_box(scene: Scene, solid: Solid, T: Array) -> list[Grasp]:
    """Return grasps across both level axes of the bounding box, the narrower one first, from the middle outwards."""
    low, high = solid.bounds
    size = high - low
    middle = (high + low) / 2
    up = int(np.abs(T[2, :3]).argmax())
    # From the middle of the box up to the height of the tip, in the frame of the part.
    rise = np.sign(T[2, up]) * (_HEIGHT - 0.5) * size[up] * np.eye(3)[up]
    # For each level axis across which the fingers close, the candidates are spread along the other one.
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
    """Return the first grasp with the largest possible margin, or None if none is clear.

    Args:
        places: Where the open gripper must be clear.
        strokes: Along which the closed gripper must be clear.
    """
    widest, *less = _MARGINS_M
    first = next(_clear(kinematics, solid, grasps, places, widest, strokes), None)
    # Grasps that are not clear with the least margin are not clear with a larger one.
    left = [] if first is not None else list(_clear(kinematics, solid, grasps, places, less[-1], strokes))
    margins = less[:-1] if left else ()
    # The widest margin, else the ones between, else the least.
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
    """Yield the grasps that are clear: the open gripper at all places, and the closed one along all strokes.

    They are computed lazily in batches; within a batch, grasps of the same orientation and width are checked together.

    Args:
        margin: Room around the gripper, [m].
    """
    T = places[0].T

    def kind(grasp: Grasp) -> tuple[float, ...]:
        """Orientation and width of a grasp: equal for grasps that can be checked together."""
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
    """Return which of k grasps of the same orientation and width are clear, (k,); see `_clear`."""
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
    """Return the tip's orientation, (3, 3), and its positions, (k, 3), world, for grasps at k points of a part.

    Args:
        grasp: Gives the orientation.
        points: In the frame of the part, (k, 3), [m].
        T: Pose of the part, (4, 4).
    """
    R = (T @ make_tip_frame(replace(grasp, point=np.zeros(3)), T))[:3, :3]
    return R, points @ T[:3, :3].T + T[:3, 3]


def _nearest(kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, margin: float) -> float:
    """Return the distance to the end of a stroke at which the closed gripper stops, [m]; 0 if it arrives.

    This is the last checked place before the first collision.
    """
    lefts = _lefts(stroke)
    struck = _closed_depth(kinematics, solid, grasp, stroke, lefts, margin) > 0.0
    # argmax: index of the first place with a collision.
    return float(lefts[max(0, int(np.argmax(struck)) - 1)]) if struck.any() else 0.0


def _lefts(stroke: Stroke) -> Array:
    """Return the distances to the end of a stroke, descending, at which collisions are checked, (k,), [m]."""
    return np.linspace(stroke.travel, 0.0, max(2, round(stroke.travel / _GRID_M) + 1))


def _closed_depth(
    kinematics: Kinematics, solid: Solid, grasp: Grasp, stroke: Stroke, lefts: Array, margin: float
) -> Array:
    """Return how deep the closed gripper intrudes into obstacles at k places of a stroke, (k,), [m].

    Args:
        lefts: Distances of the places from the end of the stroke, (k,), [m].
        margin: Room around the gripper, [m].
    """
    width = _known_width(solid.pieces, grasp, stroke.T)
    tip = stroke.T @ make_tip_frame(grasp, stroke.T)
    at = tip[:3, 3] - lefts[:, None] * stroke.direction
    return gripper_depth(kinematics, width, tip[:3, :3], at, stroke.around, margin)


def gripper_depth(
    kinematics: Kinematics, opening: float, R: Array, at: Array, around: Sequence[Obstacle], margin: float
) -> Array:
    """Return how deep the gripper intrudes into obstacles at k places, (k,), [m]; negative where it is clear.

    Obstacles that do not meet the bounding box of all places are skipped; without any, the depth is -1.

    Args:
        opening: Of each finger, [m].
        R: Orientation of the tip, (3, 3), world.
        at: Positions of the tip, (k, 3), world.
        margin: Room around the gripper, [m].
    """
    boxes = list_gripper_boxes(kinematics, opening, margin)
    low, high = measure_upright_bounds(boxes, R, np.zeros(3))
    # The bounding box of the gripper at all places together.
    low = low + at.min(axis=0)
    high = high + at.max(axis=0)
    depth = np.full(len(at), -1.0)
    for each in around:
        if (low < each.high).all() and (high > each.low).all():
            depth = np.maximum(depth, measure_intrusion_depths(boxes, R, at, each.pieces, each.T, 0.0))
    return depth
