"""Which part of a motion is rich in contact: where the hand, or what it holds, is near anything else.

What only `--fidelity contact` asks. It looks at the state of the simulation, as the physics does; the controller never
does. Boxes that a separating axis keeps apart by less than `NEAR_M` are near, which is never too few.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import intrusion_depths, upright_bounds
from apo_bench.geometry.solid import Box
from apo_bench.simulation.robot.paths import Trajectory
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import Ints, World, part_pose

NEAR_M, _NEAR_GROUP_M = 0.00015, 0.002
"""A part drifts by less than the first in a hand; parts of a group have that much play and more in each other."""
_APART_M = 0.001
"""Looks along a line are this far apart."""
_RUN_UP_S = 0.04
"""A motion is simulated from so long before it comes near: an arm that starts in motion needs that to catch up."""
_SHORTEST_S = 0.05
"""Less than this is not worth leaving out."""
_STILL_M_S, _STILL_RAD_S = 1e-3, 2e-2
"""While anything that nobody holds moves faster, nothing is left out."""
_UPRIGHT = 1e-6

_Flags = NDArray[np.bool_]
_Span = tuple[int, int]
"""The first and the last of the points of a line that are simulated."""


class Moving(NamedTuple):
    """Boxes that move with the tip, in their own frame."""

    boxes: tuple[Box, ...]
    T_tip: Array


def near_spans(
    scene: Scene,
    data: Any,
    moving: Iterable[Moving],
    held: tuple[str, ...],
    line: Trajectory,
    s: Array,
    world: World | None = None,
    run_up_s: float = _RUN_UP_S,
    near_m: float = NEAR_M,
) -> list[_Span]:
    """The stretches of a line along which something comes near, each with its run-up.

    Args:
        moving: The hand and what it holds.
        held: Which parts move with the tip.
        s: (n + 1,), how far along the line the tip is at each step, from 0 to 1.
        world: Where it moves, by default where the robot works.
        run_up_s: A motion is simulated from so long before it comes near.
        near_m: How near, for a single part.
    """
    n, world = len(s) - 1, world or scene.work
    others = [part for part in (*world.free, *world.fixed) if part not in held]
    if not _still(world, data, others):
        return [(0, n)]
    far = float(np.linalg.norm(line.end[:3, 3] - line.start[:3, 3]))
    looks = np.searchsorted(s, np.arange(0.0, s[-1], _APART_M / max(far, _APART_M)))
    looks = np.unique(np.append(looks, n))
    poses = {part: _pose(world, data, part) for part in others}
    obstacles = {part: (scene.boxes[part], T) for part, T in poses.items()}
    near = _near(moving, obstacles, line, s[looks], near_m if len(held) < 2 else _NEAR_GROUP_M)
    return _spans(near, looks, n, run_up_s, float(scene.physics.timestep_s))


def clear(scene: Scene, data: Any, moving: Iterable[Moving], held: tuple[str, ...], T: Array) -> bool:
    """Whether nothing is near while the tip stands at T."""
    return not near_spans(scene, data, moving, held, Trajectory(T, T, 0.0, np.asarray), np.zeros(1))


def _near(
    moving: Iterable[Moving],
    obstacles: Mapping[str, tuple[tuple[Box, ...], Array]],
    line: Trajectory,
    s: Array,
    margin: float,
) -> _Flags:
    """(k,), at which places along the line something is near."""
    angle = float(np.linalg.norm(line.turn))
    turning = angle > _UPRIGHT
    if turning and abs((line.start[:3, :3] @ line.turn)[2]) < (1.0 - _UPRIGHT) * angle:
        return np.ones(len(s), dtype=np.bool_)
    R, tips = line.start[:3, :3], line.start[:3, 3] + s[:, None] * (line.end[:3, 3] - line.start[:3, 3])
    near = np.zeros(len(s), dtype=np.bool_)
    for boxes, T_tip in moving:
        low, high = upright_bounds(boxes, R @ T_tip[:3, :3], R @ T_tip[:3, 3])
        if turning:
            low, high = _swept(low, high)
        for others, T in obstacles.values():
            bottom, top = upright_bounds(others, T[:3, :3], T[:3, 3])
            may = ((tips + low < top + margin) & (tips + high > bottom - margin)).all(axis=1) & ~near
            if turning:
                near |= may
            elif may.any():
                at = tips[may] + R @ T_tip[:3, 3]
                near[may] = intrusion_depths(boxes, R @ T_tip[:3, :3], at, others, T) > -margin
    return near


def _swept(low: Array, high: Array) -> tuple[Array, Array]:
    """The corners of the upright box around what an upright box sweeps while it turns about the vertical."""
    reach = float(np.hypot(*np.maximum(np.abs(low), np.abs(high))[:2]))
    return np.array([-reach, -reach, low[2]]), np.array([reach, reach, high[2]])


def _spans(near: _Flags, looks: Ints, n: int, run_up_s: float, step_s: float) -> list[_Span]:
    """Stretches that are near, begun earlier by the run-up, as one where little lies between."""
    run_up, shortest = round(run_up_s / step_s), round(_SHORTEST_S / step_s)
    spans: list[_Span] = []
    for i in map(int, np.flatnonzero(near)):
        begin, end = int(looks[max(i - 1, 0)]) - run_up, int(looks[min(i + 1, len(looks) - 1)])
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
    if part in world.dof:
        return part_pose(world, data, part)
    body, T = world.body[part], np.eye(4)
    T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return T
