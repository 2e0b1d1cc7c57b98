"""Where a part that is held can touch a wall of what is fixed with its side, before it is inserted from above.

Leaned towards the wall it touches with the place of its side that is as high as the upper edge of the wall. Two places,
one low and one high, tell where the part lies along the pads, and how it is turned about their normal: a small round
part stands on feet that are too near to each other to tell its tilt.

Where a part that is held can be laid flat on what is fixed, before it is inserted level.

Laid flush, its height and its two tilts in the hand are known (a plane on a plane, Eq. 1 of the paper), which a level
insertion needs and pads that only centre across cannot give.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from shapely import MultiPoint

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, Face, all_corners, extent, intrusion_depths, own_shape, plane_frame, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.grasping import gripper_depth, obstacles, upwards
from apo_bench.simulation.execution.transfer import Transfer, first_contact_pose
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Obstacle, shifted, turn_from, with_height
from apo_bench.simulation.scene import Scene

NOISE_LEVEL = float(np.cos(np.radians(10.0)))
"""A face that looks up by less than ten degrees off is one to lie on."""
_LOWEST_M = 1e-4
"""Corners this near to the lowest one lie on the floor."""
_LIFT_M = 0.01
"""What stood is lifted so far before it is laid down again."""
_LIFT_ROOM_M = 0.002
_LIFT_STEP_M = 0.003
"""On the way down everything else stays this far away; it is looked at this often."""


class Flush(NamedTuple):
    """A part laid flat."""

    T: Array
    """Its pose, (4, 4), world."""
    normal: Array
    """Of the floor, upwards, (3,), world."""
    feet: Array
    """Corners of the part on which it lies, (k, 3), in its own frame, [m]: at most four, far apart."""


def before_insertion(t: Transfer) -> Array:
    """Where a part is when its last motion begins, (4, 4), world."""
    before = shifted(first_contact_pose(t), t.into.way, -t.begins)
    return shifted(before, UP, t.floats) if t.into.level else before


def flush_pose(assembly: Assembly, scene: Scene, t: Transfer, believed: Poses) -> Flush | None:
    """The part flat on a fixed face straight below where a level insertion begins; before one from above, where it
    stood. None where it cannot.

    Args:
        believed: Where all parts are before the transfer.
    """
    T = before_insertion(t) if t.into.level else shifted(t.T_world_start, UP, _LIFT_M)
    up = upwards(T)
    lying = [
        each
        for part in assembly.fixed
        for face in assembly.solids[part].faces.values()
        if believed[part][2, :3] @ face.normal > NOISE_LEVEL
        for each in [_on(scene, t.part, T, up, face, believed[part])]
        if each is not None and each.T[2, 3] < T[2, 3]
    ]
    if not lying:
        return None
    highest = max(lying, key=lambda each: float(each.T[2, 3]))
    flush = highest.T
    far = float(T[2, 3] - flush[2, 3])
    lifts = np.linspace(far, 0.0, max(2, round(far / _LIFT_STEP_M)))[:, None] * UP
    others = obstacles(assembly.solids, believed, (t.part, *assembly.fixed))
    fixed = obstacles(assembly.solids, believed, (t.part, *(set(assembly.solids) - assembly.fixed)))
    R = flush[:3, :3]
    pieces = scene.pieces[t.part]
    for each in others:
        if intrusion_depths(pieces, R, flush[:3, 3] + lifts, each.pieces, each.T, _LIFT_ROOM_M).max() > -_LIFT_ROOM_M:
            return None
    for each in fixed:  # down to the floor itself, which it shall touch
        if intrusion_depths(pieces, R, flush[:3, 3] + lifts + _LOWEST_M * UP, each.pieces, each.T, 0.0).max() > 0.0:
            return None
    tip = flush @ t.grips[0].T_part_tip
    width = t.grips[0].half_width
    if gripper_depth(scene, width, tip[:3, :3], tip[:3, 3] + lifts, (*others, *fixed), 0.0).max() > 0.0:
        return None
    return highest


def _on(scene: Scene, part: str, T: Array, up: Array, floor: Face, T_floor: Array) -> Flush | None:
    """The part above a face put down flat on it, if all that lies on it is inside of its outline."""
    n = T_floor[:3, :3] @ floor.normal
    axis = np.cross(T[:3, :3] @ up, n)
    sine = float(np.linalg.norm(axis))
    flat = np.array(T)
    if sine > 0.0:
        flat[:3, :3] = pose.exp(np.append(np.zeros(3), np.arcsin(sine) / sine * axis))[:3, :3] @ T[:3, :3]
    origin = T_floor @ plane_frame(floor)
    height = float(n @ (flat[:3, 3] - origin[:3, 3])) + extent(scene.pieces[part], flat[:3, :3].T @ n)[0]
    flat[:3, 3] -= height / float(n @ UP) * UP
    corners = all_corners(scene.pieces[part])[0]
    heights = corners @ (flat[:3, :3].T @ n)
    feet = corners[heights < heights.min() + _LOWEST_M]
    on_floor = pose.apply(pose.inverse(origin) @ flat, feet)[:, :2]
    if not own_shape(floor).covers(MultiPoint(on_floor).convex_hull):
        return None
    return Flush(flat, n, feet[_far_apart(on_floor)])


def _far_apart(points: Array) -> list[int]:
    """Which of points in a plane, (k, 2), are the ends of the longest way and the ends across it; each once."""
    ahead = points - points.mean(axis=0)
    first = int(np.argmax((ahead * ahead).sum(axis=1)))
    along = ahead @ ahead[first]
    across = ahead @ np.array([-ahead[first][1], ahead[first][0]])
    ends = (first, int(np.argmin(along)), int(np.argmin(across)), int(np.argmax(across)))
    return sorted(set(ends))


LEAN_RAD = float(np.radians(3.0))
"""More than a part that was laid down is still turned in the hand."""
STAND_OFF_M = 0.004
"""A touch begins so far before it is expected."""
_OVER_M = 0.003
"""The lower place is so high over the lowest point of the part; that stays so high over the foot of the wall."""
_APART_M = 0.01
"""Places that are less far apart tell a tilt no better than feet do."""
_ROOM_M = 0.001
_STEP_M = 0.002
_LOOKS_M = 0.004


class Beside(NamedTuple):
    """One touch of a wall with the side of a part."""

    T: Array
    """Where the part is when the motion begins, (4, 4), world."""
    way: Array
    """Unit vector, (3,), world: into the wall, along which the pads do not give way."""
    point: Array
    """What touches, (3,), in the frame of the part, [m]."""
    normal: Array
    """Of the wall, outwards, (3,), world."""
    edge: Array
    """Where it is touched, (3,), world, [m]."""


def upright_walls(assembly: Assembly, poses: Poses) -> Iterator[tuple[str, Face]]:
    """Upright flat faces of what is fixed that something is fitted to, and those around a bore that something is
    fitted into."""
    done = set[tuple[str, str]]()
    for operation in assembly.operations:
        for contact in operation.contacts:
            for of in contact:
                if of.part not in assembly.fixed:
                    continue
                solid = assembly.solids[of.part]
                named = [of.face] if of.face in solid.faces else list(solid.faces)
                for name in named:
                    face = solid.faces[name]
                    upright = abs(float(poses[of.part][2, :3] @ face.normal)) < np.sqrt(1.0 - NOISE_LEVEL**2)
                    if upright and (of.part, name) not in done:
                        done.add((of.part, name))
                        yield of.part, face


def beside_places(assembly: Assembly, scene: Scene, t: Transfer, upright: Array, believed: Poses) -> tuple[Beside, ...]:
    """A low and a high place of the part at one wall; none where there is no room.

    Args:
        upright: How the part stands, (3, 3), world, but for its turn about the vertical.
        believed: Where all parts are before the transfer.
    """
    for part, face in upright_walls(assembly, believed):
        n = believed[part][:3, :3] @ face.normal
        corners = pose.apply(believed[part], face.outline)
        low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
        deep = high - low - _OVER_M
        if face.fit or deep - _OVER_M < _APART_M:
            continue
        (wall,) = obstacles(assembly.solids, believed, tuple(set(assembly.solids) - {part}))
        others = obstacles(assembly.solids, believed, (t.part, part))
        along = np.cross(UP, n)
        ends = corners @ along
        lines = np.arange(ends.min() + _STEP_M, ends.max(), _STEP_M)
        for at in sorted(lines, key=lambda at: abs(at - ends.mean())):
            edge = at * along + float(n @ corners[0]) * n + high * UP
            for R in _turned(scene, t, upright, n):
                both = tuple(_at(scene, t, R, n, edge, up) for up in (_OVER_M, deep))
                if all(_free(scene, t, each, wall, others) for each in both):
                    return both
    return ()


def _turned(scene: Scene, t: Transfer, upright: Array, n: Array) -> list[Array]:
    """How the part stands, (3, 3), when the pads are along the wall's normal, either way, the nearer to rest first."""
    rest = scene.kinematics.forward(scene.arm.home)
    y = upright @ t.grips[0].T_part_tip[:3, 1]
    both = []
    for to in (n, -n):
        turn = float(np.arctan2(np.cross(y, to) @ UP, y @ to))
        both.append(pose.exp(np.append(np.zeros(3), turn * UP))[:3, :3] @ upright)
    return sorted(both, key=lambda R: abs(turn_from(rest, frame(R @ t.grips[0].T_part_tip[:3, :3], np.zeros(3)))))


def _at(scene: Scene, t: Transfer, R: Array, n: Array, edge: Array, up: float) -> Beside:
    """The part before the wall, leaned towards it, with a point of its side that is so high over its lowest one."""
    pieces = scene.pieces[t.part]
    along = np.cross(UP, n)
    sides = extent(pieces, R.T @ along)
    point = R.T @ ((extent(pieces, R.T @ UP)[0] + up) * UP + extent(pieces, R.T @ n)[0] * n + np.mean(sides) * along)
    leaned = pose.exp(np.append(np.zeros(3), LEAN_RAD * np.cross(UP, -n)))[:3, :3] @ R
    return Beside(frame(leaned, edge + STAND_OFF_M * n - leaned @ point), -n, point, n, edge)


def _free(scene: Scene, t: Transfer, place: Beside, wall: Obstacle, others: tuple[Obstacle, ...]) -> bool:
    """Whether part and hand have room on the way straight down and to the wall, and the arm reaches there."""
    grip = t.grips[0]
    tip = place.T @ grip.T_part_tip
    above = np.arange(0.0, t.safe, _LOOKS_M)[:, None] * UP
    aside = _ROOM_M * np.cross(UP, place.normal)
    into = (STAND_OFF_M + _ROOM_M) * place.way
    whole = np.vstack([above + aside, above - aside, into + aside, into - aside])
    R = place.T[:3, :3]
    for each, shifts in ((wall, above), *((other, whole) for other in others)):
        at = place.T[:3, 3] + shifts
        if intrusion_depths(scene.pieces[t.part], R, at, each.pieces, each.T, 0.0).max() > 0.0:
            return False
    at = tip[:3, 3] + whole
    if gripper_depth(scene, grip.half_width, tip[:3, :3], at, (wall, *others), _ROOM_M).max() > 0.0:
        return False
    over = scene.kinematics.inverse(with_height(tip, t.safe), np.array(scene.arm.home))
    return over is not None and scene.kinematics.inverse(tip, over) is not None
