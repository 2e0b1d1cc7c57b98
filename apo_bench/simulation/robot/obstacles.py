"""Find the stretches of a motion on which the hand, or the parts in it, come near anything else.

Only these stretches are simulated in demonstrations and with the fidelity `near-contact`. The search reads the state of
the simulation; no command of the robot depends on it. Distances are along separating axes, which never exceed the true
distance, so no near stretch is missed.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Ints, Piece, measure_intrusion_depths, measure_upright_bounds, pose
from apo_bench.simulation.frames import body_frame
from apo_bench.simulation.robot.gripper import list_gripper_boxes
from apo_bench.simulation.robot.paths import Trajectory
from apo_bench.simulation.scene import Scene, World, get_part_pose

NEAR_HELD_M = (0.00005, 0.00015)
"""Distances that count as near: for a single held part, and for a group, whose parts may shift. The drift in the hand
during a motion is smaller."""
_PLACES = 100  # places checked along a line, if their spacing is within `_APART_M`
_APART_M = (0.0002, 0.001)  # least and greatest spacing of the checked places
RUN_UP_S = 0.04
"""Time simulated before a motion comes near: an arm that starts in motion needs this to catch up."""
_SHORTEST_S = 0.05
"""Least time between two stretches that is skipped."""
_STILL_M_S = 1e-3  # if a part that is not held moves faster, nothing is skipped
_STILL_RAD_S = 2e-2  # if a part that is not held turns faster, nothing is skipped
_UPRIGHT = 1e-6  # [rad]: a motion that turns by less is a translation

_Flags = NDArray[np.bool_]
_Span = tuple[int, int]
"""First and last index, inclusive, of the points of a line that are simulated."""


class Obstacle(NamedTuple):
    """A part that rests while another is moved."""

    pieces: tuple[Piece, ...]
    T: Array
    """Pose of the part, (4, 4), world."""
    low: Array
    """Lowest corner of the bounding box along world axes, (3,), [m]."""
    high: Array
    """Highest corner of this box, (3,), [m]."""


def make_obstacle(pieces: tuple[Piece, ...], T: Array) -> Obstacle:
    """Return a part at rest at T, (4, 4), world, with its bounding box."""
    return Obstacle(pieces, T, *measure_upright_bounds(pieces, T[:3, :3], T[:3, 3]))


class MovingPieces(NamedTuple):
    """Convex pieces that move with the tip."""

    pieces: tuple[Piece, ...]
    """In their own frame."""
    T_tip: Array
    """Pose of this frame in that of the tip, (4, 4)."""


def moving_with_tip(scene: Scene, data: Any, T_tip: Array, opening: float, held: Iterable[str]) -> list[MovingPieces]:
    """Return everything that moves with the tip: first the gripper, then each held part.

    Args:
        T_tip: Present pose of the tip, (4, 4), world.
        opening: Of each finger, [m].
        held: The held parts, at their present poses in the simulation.
    """
    inverse = pose.inverse(T_tip)
    parts = [MovingPieces(scene.pieces[part], inverse @ get_part_pose(scene.work, data, part)) for part in held]
    # Rounded, so that the cache of `list_gripper_boxes` is hit.
    return [MovingPieces(list_gripper_boxes(scene.kinematics, round(opening, 4)), np.eye(4)), *parts]


def find_near_spans(
    scene: Scene,
    data: Any,
    moving: Iterable[MovingPieces],
    held: tuple[str, ...],
    line: Trajectory,
    s: Array,
    world: World | None = None,
    run_up_s: float = RUN_UP_S,
    near_m: tuple[float, float] = NEAR_HELD_M,
) -> list[_Span]:
    """Return the stretches of a line on which something comes near, each with its run-up, as indices into `s`.

    If a part that is not held moves, the whole line is one stretch.

    Args:
        moving: The hand and the held parts.
        held: Names of the parts that move with the tip.
        s: Progress of the tip along the line at each step, (n + 1,), from 0 to 1.
        world: The world of the motion; by default that of the robot.
        run_up_s: Time simulated before the motion comes near.
        near_m: Distances that count as near, for a single part and for a group, [m].
    """
    n = len(s) - 1
    world = world or scene.work
    others = [part for part in (*world.free, *world.fixed) if part not in held]
    if not _still(world, data, others):
        return [(0, n)]
    obstacles = [make_obstacle(scene.pieces[part], _pose(world, data, part)) for part in others]
    # Indices of the steps that are checked, about evenly spaced along the line, and the last one.
    places = np.unique(np.append(np.searchsorted(s, np.arange(0.0, s[-1], _apart(line.length))), n))
    near = _near(moving, obstacles, line, s[places], near_m[len(held) > 1])  # index 1: of a group
    return _spans(near, places, n, run_up_s, float(scene.physics.timestep_s))


def clear(scene: Scene, data: Any, moving: Iterable[MovingPieces], T: Array) -> bool:
    """Whether nothing is near the empty hand while the tip stands at T."""
    # A line of length zero, checked at its one place.
    return not find_near_spans(scene, data, moving, (), Trajectory(T, T, 0.0, np.asarray), np.zeros(1))


def _near(
    moving: Iterable[MovingPieces], obstacles: Sequence[Obstacle], line: Trajectory, s: Array, margin: float
) -> _Flags:
    """Return at which places along the line something is nearer than the margin, (k,).

    On a line that turns, the box around everything that the moving pieces sweep is checked instead of the pieces.

    Args:
        s: Progress along the line at the k places.
        margin: [m].
    """
    # Upright boxes first: only where the box around what moves meets the box around what rests are pieces compared.
    R = line.start[:3, :3]
    start = line.start[:3, 3]
    tips = start + s[:, None] * (line.end[:3, 3] - start)
    near = np.zeros(len(s), dtype=np.bool_)
    turns = math.hypot(*line.turn) > _UPRIGHT
    bounds = np.array([(each.low, each.high) for each in obstacles])
    for pieces, T_tip in moving:
        low, high = measure_upright_bounds(pieces, R @ T_tip[:3, :3], R @ T_tip[:3, 3])
        if turns:
            low, high = _swept(low, high, R @ line.turn)
        low = tips + (low - margin)
        high = tips + (high + margin)
        may: _Flags = np.all((low[:, None] < bounds[:, 1]) & (high[:, None] > bounds[:, 0]), axis=-1)
        if turns:  # the bounding box of the sweep decides
            near |= may.any(axis=1)
            continue
        for i in map(int, np.flatnonzero(may.any(axis=0))):
            look = may[:, i] & ~near
            if look.any():
                at = tips[look] + R @ T_tip[:3, 3]
                T = obstacles[i].T
                depths = measure_intrusion_depths(pieces, R @ T_tip[:3, :3], at, obstacles[i].pieces, T, margin, margin)
                near[look] = depths > -margin
    return near


def _apart(far: float) -> float:
    """Return the spacing of the checked places along a line of this length, [m], as a fraction of the length."""
    least, most = _APART_M
    return min(max(far / _PLACES, least), most) / max(far, least)


def _swept(low: Array, high: Array, turn: Array) -> tuple[Array, Array]:
    """Return the corners of a box along world axes around everything that such a box sweeps as it turns.

    Args:
        low, high: Corners of the box relative to the centre of rotation, (3,), [m].
        turn: The rotation vector, (3,), world, [rad].
    """
    # Turned about an axis that is off the vertical by a level part w, a point at r moves up or out by |w| |r| at most;
    # about the vertical it stays within its distance from the axis.
    corner = np.maximum(np.abs(low), np.abs(high))
    off = float(np.hypot(*turn[:2]) * np.linalg.norm(corner))
    reach = float(np.hypot(*corner[:2])) + off
    return np.array([-reach, -reach, low[2] - off]), np.array([reach, reach, high[2] + off])


def _spans(near: _Flags, places: Ints, n: int, run_up_s: float, step_s: float) -> list[_Span]:
    """Join places that are near to stretches, begun earlier by the run-up.

    Stretches, or a stretch and an end of the line, are joined if less than `_SHORTEST_S` lies between.

    Args:
        near: For each checked place, (k,).
        places: Indices of these places along the line, (k,).
        n: Last index of the line.
    """
    run_up = round(run_up_s / step_s)
    shortest = round(_SHORTEST_S / step_s)
    spans: list[_Span] = []
    for i in map(int, np.flatnonzero(near)):
        # From the place before to the place after, since something may be near between two places.
        begin = int(places[max(i - 1, 0)]) - run_up
        end = int(places[min(i + 1, len(places) - 1)])
        begin = 0 if begin < shortest else begin
        end = n if n - end < shortest else end
        if spans and begin - spans[-1][1] < shortest:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((begin, end))
    return spans


def _still(world: World, data: Any, parts: Iterable[str]) -> bool:
    """Whether all movable ones of these parts are at rest."""
    starts = [world.dof[part] for part in parts if part in world.dof]
    speeds = np.abs(np.array([data.qvel[v : v + 6] for v in starts]).reshape(-1, 6))
    return not len(speeds) or bool(speeds[:, :3].max() < _STILL_M_S and speeds[:, 3:].max() < _STILL_RAD_S)


def _pose(world: World, data: Any, part: str) -> Array:
    """Return the pose of a movable or fixed part, (4, 4), world."""
    return get_part_pose(world, data, part) if part in world.dof else body_frame(data, world.body[part])
