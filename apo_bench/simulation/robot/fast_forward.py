"""The arm somewhere else at once, with what it holds: a stretch of a motion on which nothing is near, left out."""

from __future__ import annotations

from typing import Any

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.simulation.scene.world import World, part_pose, place

TINY_S = 1e-4
"""Speeds of the tip are differences over this time."""


def fast_forward(
    world: World,
    data: Any,
    forward: Any,
    joints: tuple[Array, Array],
    by: Array,
    velocity: Array,
    held: tuple[str, ...],
) -> None:
    """Move the arm, and what it holds as it lies in the hand, as one rigid body.

    Args:
        forward: Joint angles -> pose of the tip, (4, 4).
        joints: Addresses of the arm's joints in `qpos` and in `qvel`.
        by: (joints,), how far each joint goes, [rad].
        velocity: (joints,), how fast it is then, [rad/s].
    """
    at, dof = joints
    before = forward(data.qpos[at])
    q = data.qpos[at] + by
    after = forward(q)
    later = forward(q + TINY_S * velocity)
    data.qpos[at] = q
    data.qvel[dof] = velocity
    take_along(world, data, held, (before, after, later))


def take_along(world: World, data: Any, held: tuple[str, ...], frames: tuple[Array, Array, Array]) -> None:
    """Move parts as one rigid body with a frame, (4, 4): where it is, where it shall be, and where `TINY_S` later."""
    before, after, later = frames
    way = after @ pose.inverse(before)
    speed = (later[:3, 3] - after[:3, 3]) / TINY_S
    D = (later[:3, :3] @ after[:3, :3].T) / (2 * TINY_S)
    spin = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    for part in held:
        T = way @ part_pose(world, data, part)
        place(world, data, part, T)
        v = world.dof[part]
        data.qvel[v : v + 3] = speed + np.cross(spin, T[:3, 3] - after[:3, 3])
        data.qvel[v + 3 : v + 6] = T[:3, :3].T @ spin
