"""Find where the side of a held part can touch a fixed wall, to measure its pose before an insertion from above.

The part leans towards the wall and touches its upper edge with a point of its side. Two touches, one low and one high
on the part, show its position along the pads and its turn about their normal. The feet of a small round part are too
close together to show this turn when it is laid flat.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, Face, measure_extent, measure_intrusion_depths, pose
from apo_bench.planning.insertion.macros import UP
from apo_bench.simulation.execution.flat_placement import NOISE_LEVEL
from apo_bench.simulation.execution.grasp_clearance import gripper_depth, list_obstacles
from apo_bench.simulation.execution.transfer import Transfer
from apo_bench.simulation.frames import frame
from apo_bench.simulation.robot import Obstacle, measure_turn, move_to_height
from apo_bench.simulation.scene import Scene

LEAN_RAD = float(np.radians(3.0))
"""Angle by which the part leans: more than a part that was laid flat is still tilted in the hand."""
STAND_OFF_M = 0.004
"""Distance before the expected contact at which a touch begins."""
_OVER_M = 0.003
"""Height of the lower point over the lowest point of the part, and least height of this one over the wall's foot."""
_APART_M = 0.01
"""Least distance of both points; closer ones determine a tilt no better than feet do."""
_ROOM_M = 0.001  # distance to all other parts
_STEP_M = 0.002  # spacing of the places along the wall
_CHECKED_M = 0.004  # spacing of the places checked on the way down


class SideTouch(NamedTuple):
    """One guarded motion of a held part, and the point and wall that touch at its end."""

    T: Array
    """Pose of the part when the motion begins, (4, 4), world."""
    direction: Array
    """Direction of the motion, into the wall: unit vector, (3,), world. The pads do not give way along it."""
    point: Array
    """Point of the part that touches, (3,), in the frame of the part, [m]."""
    normal: Array
    """Unit normal of the wall, outwards, (3,), world."""
    edge: Array
    """Point of the wall's upper edge that is touched, (3,), world, [m]."""


def upright_walls(assembly: Assembly, poses: Poses) -> Iterator[tuple[str, Face]]:
    """Yield part and face of the upright flat faces of fixed parts that take part in a contact, each once.

    For a contact of a round face, such as a bore, these are all upright flat faces of its part.
    """
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


def find_side_touches(
    assembly: Assembly, scene: Scene, t: Transfer, upright: Array, estimated: Poses
) -> tuple[SideTouch, ...]:
    """Return a low and a high touch of one wall, or an empty tuple if no wall has room.

    Args:
        upright: Orientation of the part, (3, 3), world; its turn about the vertical may change.
        estimated: Estimated poses of all parts before the transfer.
    """
    for part, face in upright_walls(assembly, estimated):
        n = estimated[part][:3, :3] @ face.normal
        corners = pose.apply(estimated[part], face.outline)
        low, high = float(corners[:, 2].min()), float(corners[:, 2].max())
        deep = high - low - _OVER_M  # height of the higher point over the lowest one of the part
        if face.fit or deep - _OVER_M < _APART_M:  # a face with clearance, or a wall that is too low
            continue
        (wall,) = list_obstacles(assembly.solids, estimated, tuple(set(assembly.solids) - {part}))
        others = list_obstacles(assembly.solids, estimated, (t.part, part))
        along = np.cross(UP, n)
        ends = corners @ along
        lines = np.arange(ends.min() + _STEP_M, ends.max(), _STEP_M)
        for at in sorted(lines, key=lambda at: abs(at - ends.mean())):  # from the middle of the wall outwards
            edge = at * along + float(n @ corners[0]) * n + high * UP
            for R in _upright_turns(scene, t, upright, n):
                both = tuple(_at(scene, t, R, n, edge, up) for up in (_OVER_M, deep))
                if all(_free(scene, t, each, wall, others) for each in both):
                    return both
    return ()


def _upright_turns(scene: Scene, t: Transfer, upright: Array, n: Array) -> list[Array]:
    """Return both orientations, (3, 3), in which the y axis of the tip is along the wall's normal n, either way.

    The fingers then close along the wall. The orientation that turns the wrist less comes first.
    """
    rest = scene.kinematics.forward(scene.arm.home)
    y = upright @ t.grips[0].T_part_tip[:3, 1]
    both = []
    for to in (n, -n):
        turn = float(np.arctan2(np.cross(y, to) @ UP, y @ to))
        both.append(pose.exp(np.append(np.zeros(3), turn * UP))[:3, :3] @ upright)
    return sorted(both, key=lambda R: abs(measure_turn(rest, frame(R @ t.grips[0].T_part_tip[:3, :3], np.zeros(3)))))


def _at(scene: Scene, t: Transfer, R: Array, n: Array, edge: Array, up: float) -> SideTouch:
    """Return the touch with the point of the part's side at a height `up`, [m], over its lowest point.

    Args:
        R: Orientation of the part before it leans, (3, 3), world.
        n: Normal of the wall, outwards, (3,), world.
        edge: Point of the wall's upper edge to touch, (3,), world, [m].
    """
    pieces = scene.pieces[t.part]
    along = np.cross(UP, n)
    sides = measure_extent(pieces, R.T @ along)
    # In world axes: at this height, on the side towards the wall, in the middle along it; then in the part's frame.
    point = R.T @ (
        (measure_extent(pieces, R.T @ UP)[0] + up) * UP
        + measure_extent(pieces, R.T @ n)[0] * n
        + np.mean(sides) * along
    )
    leaned = pose.exp(np.append(np.zeros(3), LEAN_RAD * np.cross(UP, -n)))[:3, :3] @ R
    return SideTouch(frame(leaned, edge + STAND_OFF_M * n - leaned @ point), -n, point, n, edge)


def _free(scene: Scene, t: Transfer, place: SideTouch, wall: Obstacle, others: tuple[Obstacle, ...]) -> bool:
    """Whether part and hand have room on the way straight down and into the wall, and the arm reaches both ends."""
    grip = t.grips[0]
    tip = place.T @ grip.T_part_tip
    above = np.arange(0.0, t.safe, _CHECKED_M)[:, None] * UP
    aside = _ROOM_M * np.cross(UP, place.normal)
    into = (STAND_OFF_M + _ROOM_M) * place.direction
    # Shifts of the hand: on the way down and at the end in the wall, each with room on both sides along the wall.
    whole = np.vstack([above + aside, above - aside, into + aside, into - aside])
    R = place.T[:3, :3]
    for each, shifts in ((wall, above), *((other, whole) for other in others)):
        at = place.T[:3, 3] + shifts
        if measure_intrusion_depths(scene.pieces[t.part], R, at, each.pieces, each.T, 0.0).max() > 0.0:
            return False
    at = tip[:3, 3] + whole
    if gripper_depth(scene.kinematics, grip.half_width, tip[:3, :3], at, (wall, *others), _ROOM_M).max() > 0.0:
        return False
    over = scene.kinematics.inverse(move_to_height(tip, t.safe), np.array(scene.arm.home))
    return over is not None and scene.kinematics.inverse(tip, over) is not None
