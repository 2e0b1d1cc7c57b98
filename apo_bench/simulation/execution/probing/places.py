"""Places where the closed, empty hand can touch what is fixed.

Known from the plan alone: estimated poses of what stands, and shapes.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from shapely import Point

from apo_bench.assembly import Plan
from apo_bench.geometry import Array, Box, Face, flatten_face, make_plane_frame, measure_face_area, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.flat_placement import NOISE_LEVEL
from apo_bench.simulation.execution.grasping import gripper_depth, list_obstacles
from apo_bench.simulation.execution.side_touches import STAND_OFF_M, upright_walls
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Obstacle, list_gripper_boxes, translate
from apo_bench.simulation.scene import Scene

OPENING_M = 0.004
"""Of each finger while the hand touches: as good as closed, and the pads do not push on each other."""
ROOM_M = 0.003
"""Everything else stays so far away."""
_RADII_M = (0.08, 0.1, 0.06, 0.12, 0.14, 0.16, 0.18)  # of the rings around the goals on which the floor is touched
_ANGLES = 24  # places of a ring
_PATCH_M = 0.025
"""The hand touches a floor that is whole so far around."""
_SLACK = 3
"""Places of the floor: on a ring around the goals, a third of a turn apart but for so many of its parts."""
_END_M = 1e-4  # shapes that end within this of the farthest end touch
_OVER_M = 0.003
"""A wall is touched so high over its foot, with the lowest part of the fingers."""
_LIFT_M = 0.12  # the hand comes straight down from so far above
_CHECKED_M = 0.004  # its room is checked at places this far apart


StandOff = Callable[[Array, Array], float]
"""How far before a face a touch begins, [m], by the pose of the tip there, (4, 4), and the normal of the face."""


class TouchPlace(NamedTuple):
    """One guarded motion of the empty hand, and what it will touch."""

    T_world_tip: Array
    """Where the motion begins, (4, 4), [m]."""
    direction: Array
    """Unit vector, (3,), world: into the face."""
    patch: Array
    """Corners of what touches, (k, 3), in the frame of the tip, [m]: of a hand that is tilted one of them does."""
    normal: Array
    """Of the face, outwards, (3,), world."""
    offset: float
    """normal . x = offset on it, [m]."""
    stand_off: float
    """So far before the face the motion begins, [m]."""


def usual_stand_off(T_world_tip: Array, normal: Array) -> float:
    """That of a robot that is nearly right."""
    return STAND_OFF_M


def floor_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """Up to three places of what carries everything, around the goals; none where the hand has no room."""
    found = _floor(plan)
    if found is None:
        return ()
    part, face = found
    T = plan.start[part]
    n = T[:3, :3] @ face.normal
    d = float(n @ (T[:3, :3] @ face.outline[0] + T[:3, 3]))
    around = list_obstacles(plan.assembly.solids, plan.start, (part,))
    rest = scene.kinematics.forward(scene.arm.home)[:3, :3]
    patch = _lowest(_boxes(scene))
    point = patch.mean(axis=0)
    middle = plan.target_poses[:, :2, 3].mean(axis=0)
    to_face = pose.inverse(T @ make_plane_frame(face))

    def at(radius: float, k: int) -> TouchPlace | None:
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
                near = sorted(range(-_SLACK, _SLACK + 1), key=abs)
                three += [free[k] for s in near if (k := (first + third + s) % _ANGLES) in free][:1]
            best = max(best, three, key=len)
            if len(best) == 3:
                return tuple(best)
    return tuple(best)


def wall_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """One place on each wall of what is fixed that locates a later fit."""
    ahead = np.array([0.0, 1.0])
    around = list_obstacles(plan.assembly.solids, plan.start, ())
    places = [
        _with_room(scene, around, face, plan.start[part], ahead, stand_off)
        for part, face in upright_walls(plan.assembly, plan.start)
    ]
    return tuple(place for place in places if place is not None)


def opposite_places(plan: Plan, scene: Scene, stand_off: StandOff = usual_stand_off) -> tuple[TouchPlace, ...]:
    """One wall touched by either side of the fingers along which they close, the hand turned by half; none without.

    There the fingers give way, on both sides: only the difference of the two is used.
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


def _floor(plan: Plan) -> tuple[str, Face] | None:
    """The largest fixed face that looks up."""
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
    """The middle of a wall, from as far as wanted, else from as near as is usual; None where there is no room."""
    for way_off in dict.fromkeys((stand_off, usual_stand_off)):
        place = _at_wall(scene, face, T, ahead, way_off)
        if _free(scene, place.T_world_tip, around):
            return place
    return None


def _at_wall(scene: Scene, face: Face, T: Array, ahead: Array, stand_off: StandOff) -> TouchPlace:
    """The middle of a wall, touched low by a side of the fingers.

    Args:
        ahead: The side, a direction of the tip, (2,): x or y, up to its sign.
    """
    n = T[:3, :3] @ face.normal
    corners = face.outline @ T[:3, :3].T + T[:3, 3]
    low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
    d = float(n @ corners[0]) - (1e-3 * scene.clearance_mm if face.fit else 0.0)
    into = n[2] * UP - n
    into /= np.linalg.norm(into)
    # Looking down, y = z x x = -up x x: of the way into the wall, ahead is what it is in the frame of the tip.
    x = ahead[0] * into + ahead[1] * np.cross(into, -UP)
    R = np.column_stack([x, np.cross(-UP, x), -UP])
    boxes = _boxes(scene)
    reach = float(_lowest(boxes)[0, 2])
    ends = [box for box in boxes if box.center[2] + box.half[2] > reach - _END_M]
    sides = [float(ahead @ box.center[:2] + np.abs(ahead) @ box.half[:2]) for box in ends]
    those = [box for box, side in zip(ends, sides, strict=True) if side > max(sides) - _END_M]
    across = np.abs(ahead[::-1])
    low_across = min(float(across @ (box.center - box.half)[:2]) for box in those)
    high_across = max(float(across @ (box.center + box.half)[:2]) for box in those)
    foot = low + min(_OVER_M, (high - low) / 2)
    common = min(high - foot, 2.0 * min(float(box.half[2]) for box in ends))
    level = [max(sides) * ahead + reach_across * across for reach_across in (low_across, high_across)]
    patch = np.array([(*xy, z) for xy in level for z in (reach - common, reach)])
    touched = np.append(corners[:, :2].mean(axis=0), foot + common / 2)
    touched += (d - n @ touched) * n
    there = frame(R, touched - R @ patch.mean(axis=0))
    away = stand_off(there, n)
    return TouchPlace(translate(there, n, away), -n, patch, n, d, away)


def _boxes(scene: Scene) -> tuple[Box, ...]:
    return list_gripper_boxes(scene.kinematics, OPENING_M)


def _lowest(boxes: Sequence[Box]) -> Array:
    """The corners of what reaches farthest ahead, (4, 3), in the frame of the tip."""
    reach = max(float(box.center[2] + box.half[2]) for box in boxes)
    ends = [box for box in boxes if box.center[2] + box.half[2] > reach - _END_M]
    low = np.min([box.center - box.half for box in ends], axis=0)
    high = np.max([box.center + box.half for box in ends], axis=0)
    return np.array([(x, y, reach) for x in (low[0], high[0]) for y in (low[1], high[1])])


def _free(scene: Scene, T: Array, around: Sequence[Obstacle]) -> bool:
    """Whether the hand can come straight down to a pose that the arm reaches."""
    lifts = np.arange(0.0, _LIFT_M, _CHECKED_M)[:, None] * UP
    if gripper_depth(scene.kinematics, OPENING_M, T[:3, :3], T[:3, 3] + lifts, around, ROOM_M).max() > 0.0:
        return False
    above = scene.kinematics.inverse(translate(T, UP, _LIFT_M), np.array(scene.arm.home))
    return above is not None and scene.kinematics.inverse(T, above) is not None
