"""Find where a held part can be laid flat on a fixed face before its insertion, to measure its pose in the hand.

A part that lies on a plane has a known height and two known tilts (plane on plane, Eq. 1 of the paper). A level
insertion needs these, and the pads determine only the position between them.
"""

from typing import NamedTuple

import numpy as np
from shapely import MultiPoint

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import (
    Array,
    Face,
    collect_corners,
    flatten_face,
    make_plane_frame,
    measure_extent,
    measure_intrusion_depths,
    pose,
)
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.grasp_clearance import gripper_depth, list_obstacles
from apo_bench.simulation.execution.grasp_frame import upwards
from apo_bench.simulation.execution.transfer import Transfer, first_contact_pose
from apo_bench.simulation.robot import translate
from apo_bench.simulation.scene import Scene

NOISE_LEVEL = float(np.cos(np.radians(10.0)))
"""Least upward component of the normal of a face on which a part can lie: at most 10 degrees of tilt."""
_LOWEST_M = 1e-4
"""Corners within this height of the lowest one are feet."""
_LIFT_M = 0.01
"""Height to which a part is lifted before it is laid down where it stood."""
_LIFT_ROOM_M = 0.002  # distance to all other parts on the way down
_LIFT_STEP_M = 0.003  # spacing of the places checked on the way down


class FlatPlacement(NamedTuple):
    """A part that lies flat on a fixed face, the floor."""

    T: Array
    """Pose of the part, (4, 4), world."""
    normal: Array
    """Unit normal of the floor, upwards, (3,), world."""
    feet: Array
    """Corners on which the part lies, (k, 3), in the frame of the part, [m]: at most four, far apart."""


def before_insertion(t: Transfer) -> Array:
    """Return the pose of the part where its guarded motion begins, (4, 4), world."""
    before = translate(first_contact_pose(t), t.into.direction, -t.begins)
    return translate(before, UP, t.floats) if t.into.level else before


def find_flat_placement(assembly: Assembly, scene: Scene, t: Transfer, estimated: Poses) -> FlatPlacement | None:
    """Return the part laid flat on the highest fixed face below it, or None if no face or no room is there.

    Before a level insertion, this is below the place where the insertion begins; before one from above, it is where the
    part stood.

    Args:
        estimated: Estimated poses of all parts before the transfer.
    """
    T = before_insertion(t) if t.into.level else translate(t.T_world_start, UP, _LIFT_M)
    up = upwards(T)
    lying = [
        each
        for part in assembly.fixed
        for face in assembly.solids[part].faces.values()
        if estimated[part][2, :3] @ face.normal > NOISE_LEVEL
        for each in [_on(scene, t.part, T, up, face, estimated[part])]
        if each is not None and each.T[2, 3] < T[2, 3]
    ]
    if not lying:
        return None
    highest = max(lying, key=lambda each: float(each.T[2, 3]))
    flush = highest.T
    far = float(T[2, 3] - flush[2, 3])
    # Displacements of the part on its way straight down, (k, 3), the last one zero.
    lifts = np.linspace(far, 0.0, max(2, round(far / _LIFT_STEP_M)))[:, None] * UP
    others = list_obstacles(assembly.solids, estimated, (t.part, *assembly.fixed))
    fixed = list_obstacles(assembly.solids, estimated, (t.part, *(set(assembly.solids) - assembly.fixed)))
    R = flush[:3, :3]
    pieces = scene.pieces[t.part]
    for each in others:
        if (
            measure_intrusion_depths(pieces, R, flush[:3, 3] + lifts, each.pieces, each.T, _LIFT_ROOM_M).max()
            > -_LIFT_ROOM_M
        ):
            return None
    for each in fixed:  # without margin, since the part touches the floor
        if (
            measure_intrusion_depths(pieces, R, flush[:3, 3] + lifts + _LOWEST_M * UP, each.pieces, each.T, 0.0).max()
            > 0.0
        ):
            return None
    tip = flush @ t.grips[0].T_part_tip
    width = t.grips[0].half_width
    if gripper_depth(scene.kinematics, width, tip[:3, :3], tip[:3, 3] + lifts, (*others, *fixed), 0.0).max() > 0.0:
        return None
    return highest


def _on(scene: Scene, part: str, T: Array, up: Array, floor: Face, T_floor: Array) -> FlatPlacement | None:
    """Return the part turned flat and lowered onto a face, or None if a foot is outside of its outline.

    Args:
        T: Pose of the part above the face, (4, 4), world.
        up: Direction in the frame of the part, (3,), that becomes the normal of the face.
        floor: The face, of a fixed part at `T_floor`.
    """
    n = T_floor[:3, :3] @ floor.normal
    # Turn the part by the smallest angle that brings `up` onto the normal.
    axis = np.cross(T[:3, :3] @ up, n)
    sine = float(np.linalg.norm(axis))
    flat = np.array(T)
    if sine > 0.0:
        flat[:3, :3] = pose.exp(np.append(np.zeros(3), np.arcsin(sine) / sine * axis))[:3, :3] @ T[:3, :3]
    origin = T_floor @ make_plane_frame(floor)
    # Then lower it vertically until its lowest point is in the plane of the floor.
    height = float(n @ (flat[:3, 3] - origin[:3, 3])) + measure_extent(scene.pieces[part], flat[:3, :3].T @ n)[0]
    flat[:3, 3] -= height / float(n @ UP) * UP
    corners = collect_corners(scene.pieces[part])[0]
    heights = corners @ (flat[:3, :3].T @ n)
    feet = corners[heights < heights.min() + _LOWEST_M]
    on_floor = pose.apply(pose.inverse(origin) @ flat, feet)[:, :2]
    if not flatten_face(floor).covers(MultiPoint(on_floor).convex_hull):
        return None
    return FlatPlacement(flat, n, feet[_far_apart(on_floor)])


def _far_apart(points: Array) -> list[int]:
    """Return the indices of up to four far points in a plane, (k, 2): both ends of the shape, along and across.

    The first is farthest from the mean, the second is at the opposite end, and the others are the ends across.
    """
    ahead = points - points.mean(axis=0)
    first = int(np.argmax((ahead * ahead).sum(axis=1)))
    # Coordinates, up to a factor, along the direction to the first point and perpendicular to it.
    along = ahead @ ahead[first]
    across = ahead @ np.array([-ahead[first][1], ahead[first][0]])
    ends = (first, int(np.argmin(along)), int(np.argmin(across)), int(np.argmax(across)))
    return sorted(set(ends))
