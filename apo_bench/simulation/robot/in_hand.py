"""Move what is in the hand: keep it there on its way, take it along at once, weld it.

What is carried freely stays where it is in the hand. A contact of MuJoCo solves J a = -b J v, where J v is the speed
of one side past the other. The acceleration of one side past the other is J a + dJ/dt v, and dJ/dt v is not zero where
contacts move along an arc. So the pads take a carried part along with an error of some |dJ/dt v| / b, 1 mm/s: it creeps
by 0.1 to 1.1 mm until it is above its goal. With dJ/dt v taken off the right side, step by step, 0.77 mm became 0.03 at
best and 0.41 became 0.18 at worst; that would cost more than it is worth here.
Friction, the force and stiffness of the fingers and the softness of friction change it by at most 0.04 mm. Half the
speed halves it; so does half the time constant of the pads, with which parts that are off slip in.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.frames import body_frame, quaternion
from apo_bench.simulation.scene import Scene, World, get_part_pose, set_part_pose, touches_others

SLIPS_M = 5e-5
"""What moves farther in the hand in a tick does not creep: it slips."""
TINY_S = 1e-4
"""Speeds of the tip are differences over this time."""


class Carried(NamedTuple):
    """What is in the hand on a way through the air."""

    parts: tuple[str, ...]
    """The part that the fingers hold, then those that it carries."""
    T_tip_part: Array | None = None
    """Where the first part is kept in the hand, (4, 4); None while it is not carried freely."""


def hold_steady(world: World, data: Any, T_world_tip: Array, carried: Carried) -> Carried:
    """Put what is carried back where it was in the hand a tick ago, as one rigid body; speeds stay.

    Nothing is put back while any of it touches anything but the hand, and what slips in earnest is left to slip.
    """
    if touches_others(world, data, carried.parts):
        return carried._replace(T_tip_part=None)
    now = get_part_pose(world, data, carried.parts[0])
    if carried.T_tip_part is not None:
        wanted = T_world_tip @ carried.T_tip_part
        if np.linalg.norm((wanted - now)[:3, 3]) <= SLIPS_M:
            shift = wanted @ pose.inverse(now)
            velocity = np.array(data.qvel)
            for part in carried.parts:
                set_part_pose(world, data, part, shift @ get_part_pose(world, data, part))
            data.qvel[:] = velocity
            return carried
    return carried._replace(T_tip_part=pose.inverse(T_world_tip) @ now)


def fast_forward(
    world: World,
    data: Any,
    forward: Callable[[Array], Array],
    joints: tuple[Array, Array],
    by: Array,
    velocity: Array,
    held: tuple[str, ...],
) -> None:
    """Bring the arm somewhere else at once, and what it holds as it lies in the hand: nothing is near on the way.

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
    """Move parts as one rigid body with a frame, (4, 4): where it is, where it goes, and where `TINY_S` later."""
    before, after, later = frames
    way = after @ pose.inverse(before)
    # Velocity of the frame by differences; R(later) R(after)^T is 1 + hat(spin) TINY_S to first order, so the spin is
    # its antisymmetric part.
    speed = (later[:3, 3] - after[:3, 3]) / TINY_S
    D = (later[:3, :3] @ after[:3, :3].T) / (2 * TINY_S)
    spin = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    for part in held:
        T = way @ get_part_pose(world, data, part)
        set_part_pose(world, data, part, T)
        v = world.dof[part]
        # v = v_frame + spin x lever; MuJoCo has the spin of a free body in the frame of the body.
        data.qvel[v : v + 3] = speed + np.cross(spin, T[:3, 3] - after[:3, 3])
        data.qvel[v + 3 : v + 6] = T[:3, :3].T @ spin


def weld(scene: Scene, data: Any, part: str, on: bool) -> None:
    """The ideal gripper: hold a part exactly as it now is, or let go."""
    model = scene.work.model
    weld = model.equality(f"grasp_{part}").id
    if on:
        mount = body_frame(data, model.body(f"arm/{scene.arm.mount}").id)
        T = pose.inverse(mount) @ body_frame(data, model.body(f"{part}/").id)
        model.eq_data[weld, :11] = (0, 0, 0, *T[:3, 3], *quaternion(T), 1)
    data.eq_active[weld] = int(on)
