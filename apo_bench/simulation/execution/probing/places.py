"""Find places where the closed, empty hand can touch the floor and walls of fixed parts.

They follow from the plan alone: estimated poses and shapes of the parts.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from shapely import Point

from apo_bench.assembly import Plan
from apo_bench.geometry import Array, Box, Face, flatten_face, make_plane_frame, measure_face_area, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.flat_placement import NOISE_LEVEL
from apo_bench.simulation.execution.grasp_clearance import gripper_depth, list_obstacles
from apo_bench.simulation.execution.side_touches import STAND_OFF_M, upright_walls
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Obstacle, list_gripper_boxes, translate
from apo_bench.simulation.scene import Scene

OPENING_M = 0.004
"""Opening of each finger during touches: nearly closed, but the pads do not push on each other."""
ROOM_M = 0.003
"""Distance to all other parts."""
_RADII_M = (0.08, 0.1, 0.06, 0.12, 0.14, 0.16, 0.18)  # radii of the rings of floor places, in the order of preference
_ANGLES = 24  # number of places on a ring
_PATCH_M = 0.025
"""Radius around a place within which the floor must have no edge or hole."""
_SLACK = 3
"""Greatest deviation of floor places from a third of a turn apart, in steps of the ring."""
_END_M = 1e-4  # boxes that end within this distance of the farthest end touch too
_OVER_M = 0.003
"""Height over the foot of a wall at which the lowest part of the fingers touches it."""
_LIFT_M = 0.12  # height from which the hand comes straight down
_CHECKED_M = 0.004  # spacing of the places checked on this way


StandOff = Callable[[Array, Array], float]
"""Pose of the tip at a touch, (4, 4), and normal of the face, (3,) -> distance before the face at which the touch
begins, [m]."""


class TouchPlace(NamedTuple):
    """One guarded motion of the empty hand, and the plane that it will touch."""

    T_world_tip: Array
    """Tip pose at which the motion begins, (4, 4)."""
    direction: Array
    """Direction of the motion, into the face: unit vector, (3,), world."""
    patch: Array
    """Corners of the hand's touching area, (k, 3), in the frame of the tip, [m]; a tilted hand touches with one."""
    normal: Array
    """Unit normal of the face, outwards, (3,), world."""
    offset: float
    """The plane of the face is normal . x = offset, [m]."""
    stand_off: float
    """Distance before the face at which the motion begins, [m]."""
    opening: float = OPENING_M
    """Opening of each finger, [m]."""
    inner: bool = False
    """Whether the inner side of one finger touches: a pad."""


def usual_stand_off(T_world_tip: Array, normal: Array) -> float:
    """Return the distance for a robot with small errors."""
    return STAND_OFF_M


def floor_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """Return up to three places on the largest upward fixed face, on a ring around the goals.

    Places without room for the hand are left out; the first ring with three places is used.
    """
    found = _floor(plan)
    if found is None:
        return ()
    part, face = found
    T = plan.start[part]
    # The plane of the floor: n . x = d, world.
    n = T[:3, :3] @ face.normal
    d = float(n @ (T[:3, :3] @ face.outline[0] + T[:3, 3]))
    around = list_obstacles(plan.assembly.solids, plan.start, (part,))
    rest = scene.kinematics.forward(scene.arm.home)[:3, :3]
    patch = _lowest(_boxes(scene))
    point = patch.mean(axis=0)
    middle = plan.target_poses[:, :2, 3].mean(axis=0)
    to_face = pose.inverse(T @ make_plane_frame(face))

    def at(radius: float, k: int) -> TouchPlace | None:
        """Return the k-th place of a ring, None if the floor ends nearby or the hand has no room."""
        angle = 2.0 * np.pi * (k % _ANGLES) / _ANGLES
        x, y = middle + radius * np.array([np.cos(angle), np.sin(angle)])
        touched = np.array([x, y, (d - n[0] * x - n[1] * y) / n[2]])
        there = frame(rest, touched - rest @ point)
        away = stand_off(there, n)
        begins = translate(there, n, away)
        if not flatten_face(face).contains(Point(pose.apply(to_face, touched[None])[0, :2]).buffer(_PATCH_M)):
            return None
        return TouchPlace(begins, -n, patch, n, d, away) if _free(scene, begins, around) else None

    best: list[TouchPlace] = []
    for radius in _RADII_M:
        free = {k: place for k in range(_ANGLES) if (place := at(radius, k)) is not None}
        for first in free:
            three = [free[first]]
            for third in (_ANGLES // 3, 2 * _ANGLES // 3):
                # The free place nearest to the exact third of a turn, if there is one.
                near = sorted(range(-_SLACK, _SLACK + 1), key=abs)
                three += [free[k] for s in near if (k := (first + third + s) % _ANGLES) in free][:1]
            best = max(best, three, key=len)
            if len(best) == 3:
                return tuple(best)
    return tuple(best)


def wall_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """Return one place on each wall from `upright_walls`, if the hand has room.

    The hand touches with the side along its y axis, in which the fingers are stiff.
    """
    ahead = np.array([0.0, 1.0])
    around = list_obstacles(plan.assembly.solids, plan.start, ())
    places = [
        _with_room(scene, around, face, plan.start[part], ahead, stand_off)
        for part, face in upright_walls(plan.assembly, plan.start)
    ]
    return tuple(place for place in places if place is not None)


def opposite_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """Return two places on one wall, touched by opposite sides of the hand along the closing direction, or none.

    The hand is turned by a half turn between them. The fingers give way along this direction, so only the difference of
    both touches is used.
    """
    around = list_obstacles(plan.assembly.solids, plan.start, ())
    for part, face in upright_walls(plan.assembly, plan.start):
        both = [
            place
            for sign in (1.0, -1.0)
            for place in [_with_room(scene, around, face, plan.start[part], np.array([sign, 0.0]), stand_off)]
            if place is not None
        ]
        if len(both) == 2:
            return tuple(both)
    return ()


def inner_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """Return two places on opposite walls of a fixed part, touched by the pads of the open hand around it, or none.

    The fingers give way, so only the difference of both touches is used: it is twice the offset of the pads' middle.
    The touches begin at the usual distance, since the hand is calibrated by then.
    """
    around = list_obstacles(plan.assembly.solids, plan.start, ())
    for part, face in upright_walls(plan.assembly, plan.start):
        for other in plan.assembly.solids[part].faces.values():
            half = -0.5 * float(face.normal @ (other.outline[0] - face.outline[0]))
            opening = half + STAND_OFF_M
            if other.normal @ face.normal > -NOISE_LEVEL or opening > scene.arm.opening_m:
                continue
            both = [
                _at_wall(scene, wall, plan.start[part], np.array([sign, 0.0]), usual_stand_off, opening, inner=True)
                for wall, sign in ((face, 1.0), (other, -1.0))
            ]
            if all(_free(scene, place.T_world_tip, around, opening) for place in both):
                return tuple(both)
    return ()


def _floor(plan: Plan) -> tuple[str, Face] | None:
    """Return part and face of the largest fixed face that points up, None if there is none."""
    up = [
        (part, face)
        for part in sorted(plan.assembly.fixed)
        for face in plan.assembly.solids[part].faces.values()
        if plan.start[part][2, :3] @ face.normal > NOISE_LEVEL
    ]
    return max(up, key=lambda each: measure_face_area(each[1]), default=None)


def _with_room(
    scene: Scene, around: Sequence[Obstacle], face: Face, T: Array, ahead: Array, stand_off: StandOff
) -> TouchPlace | None:
    """Return a place in the middle of a wall, None if the hand has no room.

    The motion begins at the wanted distance, or else at the usual one.
    """
    for way_off in dict.fromkeys((stand_off, usual_stand_off)):
        place = _at_wall(scene, face, T, ahead, way_off)
        if _free(scene, place.T_world_tip, around):
            return place
    return None


def _at_wall(
    scene: Scene,
    face: Face,
    T: Array,
    ahead: Array,
    stand_off: StandOff,
    opening: float = OPENING_M,
    inner: bool = False,
) -> TouchPlace:
    """Return a place in the middle of a wall, near its foot, touched by a side of the fingers.

    Args:
        T: Pose of the part with the wall, (4, 4), world.
        ahead: Outward direction of this side in the x-y plane of the tip, (2,): along x or y, of either sign.
        stand_off: Gives the distance at which the motion begins.
        opening: Of each finger, [m].
        inner: Whether only the rear finger touches, with its inner side.
    """
    n = T[:3, :3] @ face.normal
    corners = face.outline @ T[:3, :3].T + T[:3, 3]
    low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
    d = float(n @ corners[0]) - (1e-3 * scene.clearance_mm if face.fit else 0.0)
    into = n[2] * UP - n  # level direction into the wall
    into /= np.linalg.norm(into)
    # The tip looks down, so y = z x x = -up x x. The tip is turned so that `ahead` points into the wall.
    x = ahead[0] * into + ahead[1] * np.cross(into, -UP)
    R = np.column_stack([x, np.cross(-UP, x), -UP])
    boxes = list_gripper_boxes(scene.kinematics, opening)
    reach = float(_lowest(boxes)[0, 2])
    ends = [box for box in boxes if box.center[2] + box.half[2] > reach - _END_M]
    ends = [box for box in ends if not inner or ahead @ box.center[:2] < 0.0]
    sides = [float(ahead @ box.center[:2] + np.abs(ahead) @ box.half[:2]) for box in ends]
    # The boxes that touch, and their extent across `ahead`.
    those = [box for box, side in zip(ends, sides, strict=True) if side > max(sides) - _END_M]
    across = np.abs(ahead[::-1])
    low_across = min(float(across @ (box.center - box.half)[:2]) for box in those)
    high_across = max(float(across @ (box.center + box.half)[:2]) for box in those)
    foot = low + min(_OVER_M, (high - low) / 2)
    # Height over which the side of the fingers and the wall overlap.
    common = min(high - foot, 2.0 * min(float(box.half[2]) for box in ends))
    level = [max(sides) * ahead + reach_across * across for reach_across in (low_across, high_across)]
    patch = np.array([(*xy, z) for xy in level for z in (reach - common, reach)])
    touched = np.append(corners[:, :2].mean(axis=0), foot + common / 2)
    touched += (d - n @ touched) * n
    there = frame(R, touched - R @ patch.mean(axis=0))
    away = stand_off(there, n)
    return TouchPlace(translate(there, n, away), -n, patch, n, d, away, opening, inner)


def _boxes(scene: Scene) -> tuple[Box, ...]:
    """Return the boxes of the gripper at the opening for touches, in the frame of the tip."""
    return list_gripper_boxes(scene.kinematics, OPENING_M)


def _lowest(boxes: Sequence[Box]) -> Array:
    """Return the corners of the end face of the fingers, (4, 3), in the frame of the tip, [m]: farthest along z."""
    reach = max(float(box.center[2] + box.half[2]) for box in boxes)
    ends = [box for box in boxes if box.center[2] + box.half[2] > reach - _END_M]
    low = np.min([box.center - box.half for box in ends], axis=0)
    high = np.max([box.center + box.half for box in ends], axis=0)
    return np.array([(x, y, reach) for x in (low[0], high[0]) for y in (low[1], high[1])])


def _free(scene: Scene, T: Array, around: Sequence[Obstacle], opening: float = OPENING_M) -> bool:
    """Whether the hand has room straight down to a tip pose T, and the arm reaches both ends of this way."""
    lifts = np.arange(0.0, _LIFT_M, _CHECKED_M)[:, None] * UP
    if gripper_depth(scene.kinematics, opening, T[:3, :3], T[:3, 3] + lifts, around, ROOM_M).max() > 0.0:
        return False
    above = scene.kinematics.inverse(translate(T, UP, _LIFT_M), np.array(scene.arm.home))
    return above is not None and scene.kinematics.inverse(T, above) is not None
