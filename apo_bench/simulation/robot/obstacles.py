"""Find the stretches of a motion on which the hand, or what it holds, is near anything else.

The hands that demonstrate use it, and the robot only with the fidelity `near-contact`. It reads the state of the
simulation, as the physics does; no command of the robot depends on it. Boxes that a separating axis
keeps apart by less than `NEAR_HELD_M` are near, which is never too few.
"""

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
"""A part in a hand drifts by less than the first on its way; parts of a group, which shift, by less than the second."""
_PLACES = 100  # places checked along a line
_APART_M = (0.0002, 0.001)  # not closer together than the first, nor farther apart than the second
_RUN_UP_S = 0.04
"""A motion is simulated from so long before it comes near: an arm that starts in motion needs that to catch up."""
_SHORTEST_S = 0.05
"""Less than this is not worth leaving out."""
_STILL_M_S = 1e-3  # while a part that is not held moves faster, nothing is left out
_STILL_RAD_S = 2e-2  # or turns faster
_UPRIGHT = 1e-6

_Flags = NDArray[np.bool_]
_Span = tuple[int, int]
"""The first and the last of the points of a line that are simulated."""


class Obstacle(NamedTuple):
    """A part that rests while another is moved."""

    pieces: tuple[Piece, ...]
    T: Array
    low: Array
    """The lowest corner of the upright box around it, (3,), world, [m]."""
    high: Array


def make_obstacle(pieces: tuple[Piece, ...], T: Array) -> Obstacle:
    """A part that rests at T."""
    return Obstacle(pieces, T, *measure_upright_bounds(pieces, T[:3, :3], T[:3, 3]))


class MovingPieces(NamedTuple):
    """Pieces that move with the tip, in their own frame."""

    pieces: tuple[Piece, ...]
    T_tip: Array


def moving_with_tip(scene: Scene, data: Any, T_tip: Array, opening: float, held: Iterable[str]) -> list[MovingPieces]:
    """The gripper at an opening [m], and the parts that it holds, as they move with the tip."""
    inverse = pose.inverse(T_tip)
    parts = [MovingPieces(scene.pieces[part], inverse @ get_part_pose(scene.work, data, part)) for part in held]
    return [MovingPieces(list_gripper_boxes(scene.kinematics, round(opening, 4)), np.eye(4)), *parts]


def find_near_spans(
    scene: Scene,
    data: Any,
    moving: Iterable[MovingPieces],
    held: tuple[str, ...],
    line: Trajectory,
    s: Array,
    world: World | None = None,
    run_up_s: float = _RUN_UP_S,
    near_m: tuple[float, float] = NEAR_HELD_M,
) -> list[_Span]:
    """The stretches of a line along which something comes near, each with its run-up.

    Args:
        moving: The hand and what it holds.
        held: Which parts move with the tip.
        s: (n + 1,), how far along the line the tip is at each step, from 0 to 1.
        world: Where it moves, by default where the robot works.
        run_up_s: A motion is simulated from so long before it comes near.
        near_m: How near, for a single part and for a group, [m].
    """
    n = len(s) - 1
    world = world or scene.work
    others = [part for part in (*world.free, *world.fixed) if part not in held]
    if not _still(world, data, others):
        return [(0, n)]
    obstacles = [make_obstacle(scene.pieces[part], _pose(world, data, part)) for part in others]
    places = np.unique(np.append(np.searchsorted(s, np.arange(0.0, s[-1], _apart(line.length))), n))
    near = _near(moving, obstacles, line, s[places], near_m[len(held) > 1])
    return _spans(near, places, n, run_up_s, float(scene.physics.timestep_s))


def clear(scene: Scene, data: Any, moving: Iterable[MovingPieces], T: Array) -> bool:
    """Whether nothing is near the empty hand while the tip stands at T."""
    return not find_near_spans(scene, data, moving, (), Trajectory(T, T, 0.0, np.asarray), np.zeros(1))


def _near(
    moving: Iterable[MovingPieces], obstacles: Sequence[Obstacle], line: Trajectory, s: Array, margin: float
) -> _Flags:
    """(k,), at which places along the line something is near.

    What turns is taken as the box around all that it sweeps, and nothing else is checked.
    """
    # Upright boxes first: only where the box around what moves meets the box around what rests are pieces compared.
    R = line.start[:3, :3]
    start = line.start[:3, 3]
    tips = start + s[:, None] * (line.end[:3, 3] - start)
    near = np.zeros(len(s), dtype=np.bool_)
    turns = float(np.linalg.norm(line.turn)) > _UPRIGHT
    bounds = np.array([(each.low, each.high) for each in obstacles])
    for pieces, T_tip in moving:
        low, high = measure_upright_bounds(pieces, R @ T_tip[:3, :3], R @ T_tip[:3, 3])
        if turns:
            low, high = _swept(low, high, R @ line.turn)
        low = tips + (low - margin)
        high = tips + (high + margin)
        may: _Flags = np.all((low[:, None] < bounds[:, 1]) & (high[:, None] > bounds[:, 0]), axis=-1)
        if turns:
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
    """How far apart the checked places are along a line of this length, [m], as a part of it."""
    least, most = _APART_M
    return min(max(far / _PLACES, least), most) / max(far, least)


def _swept(low: Array, high: Array, turn: Array) -> tuple[Array, Array]:
    """The corners of an upright box around what an upright box sweeps while it turns about the origin.

    Args:
        turn: (3,), the rotation vector, world, [rad]. Without its level part everything turns about the vertical; with
            it nothing is further from there than that part times how far it is from the origin.
    """
    # Turned about an axis that is off the vertical by a level part w, a point at r moves up or out by |w| |r| at most;
    # about the vertical it stays within its distance from the axis.
    corner = np.maximum(np.abs(low), np.abs(high))
    off = float(np.hypot(*turn[:2]) * np.linalg.norm(corner))
    reach = float(np.hypot(*corner[:2])) + off
    return np.array([-reach, -reach, low[2] - off]), np.array([reach, reach, high[2] + off])


def _spans(near: _Flags, places: Ints, n: int, run_up_s: float, step_s: float) -> list[_Span]:
    """Stretches that are near, begun earlier by the run-up, as one where little lies between."""
    run_up = round(run_up_s / step_s)
    shortest = round(_SHORTEST_S / step_s)
    spans: list[_Span] = []
    for i in map(int, np.flatnonzero(near)):
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
    starts = [world.dof[part] for part in parts if part in world.dof]
    speeds = np.abs(np.array([data.qvel[v : v + 6] for v in starts]).reshape(-1, 6))
    return not len(speeds) or bool(speeds[:, :3].max() < _STILL_M_S and speeds[:, 3:].max() < _STILL_RAD_S)


def _pose(world: World, data: Any, part: str) -> Array:
    return get_part_pose(world, data, part) if part in world.dof else body_frame(data, world.body[part])
