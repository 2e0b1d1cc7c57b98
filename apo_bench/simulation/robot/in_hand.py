"""Set the poses of held parts in the simulation: free of creep, moved along with the hand, or welded to it.

`hold_steady` removes an artefact of the contact model. A contact of MuJoCo solves J a = -b J v, where J v is the
relative velocity of both sides. Their relative acceleration is J a + dJ/dt v, and dJ/dt v is not zero where contacts
move along an arc. So the pads carry a part with a velocity error of some |dJ/dt v| / b, 1 mm/s: the part creeps by 0.1
to 1.1 mm until it is above its goal. Subtracting dJ/dt v on the right side at each step reduced 0.77 mm to 0.03 at
best, and 0.41 to 0.18 at worst. This does not justify its cost.

Friction, the force and stiffness of the fingers and the softness of friction change the creep by at most 0.04 mm. Half
the speed halves it. Half the time constant of the pads does too, but then misplaced parts slip into place.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.frames import body_frame, cross, quaternion
from apo_bench.simulation.scene import Scene, World, get_part_pose, move_part, touches_others

SLIPS_M = 5e-5
"""Displacement in the hand within a tick above which a part slips, and is not put back."""
TINY_S = 1e-4
"""Time step of the finite differences that give the velocity of the tip."""


class Carried(NamedTuple):
    """The parts in the hand during a motion through the air."""

    parts: tuple[str, ...]
    """The part that the fingers hold, then those that it carries."""
    T_tip_part: Array | None = None
    """Pose of the first part in the frame of the tip that is kept, (4, 4); None while a part touches other things."""


def hold_steady(world: World, data: Any, T_world_tip: Array, carried: Carried) -> Carried:
    """Undo the creep of one tick: move the carried parts back to their pose in the hand; return the new state.

    The parts move as one rigid body and keep their velocities. Nothing is moved while one of them touches anything but
    the hand, or when they slipped by more than `SLIPS_M`.

    Args:
        T_world_tip: The present pose of the tip, (4, 4).
        carried: The state after the last tick.
    """
    if touches_others(world, data, carried.parts):
        return carried._replace(T_tip_part=None)
    now = get_part_pose(world, data, carried.parts[0])
    if carried.T_tip_part is not None:
        wanted = T_world_tip @ carried.T_tip_part
        if math.dist(wanted[:3, 3], now[:3, 3]) <= SLIPS_M:  # creep; else the new pose is kept from now on
            shift = wanted @ pose.inverse(now)
            for part in carried.parts:
                move_part(world, data, part, shift @ get_part_pose(world, data, part))
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
    """Move the arm and the held parts at once, without simulation, along a stretch where nothing is near.

    Args:
        forward: Joint angles -> pose of the tip, (4, 4).
        joints: Addresses of the arm's joints in `qpos` and in `qvel`.
        by: Displacement of each joint, (joints,), [rad].
        velocity: Joint velocities afterwards, (joints,), [rad/s].
        held: The parts in the hand, which keep their poses in it.
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
    """Move parts as one rigid body with a frame, and give them the velocity of this frame.

    Args:
        frames: Poses of the frame, (4, 4), world: before the move, after it, and `TINY_S` later.
    """
    before, after, later = frames
    way = after @ pose.inverse(before)
    # Velocity of the frame by differences; R(later) R(after)^T is 1 + hat(spin) TINY_S to first order, so the spin is
    # its antisymmetric part.
    speed = (later[:3, 3] - after[:3, 3]) / TINY_S
    D = (later[:3, :3] @ after[:3, :3].T) / (2 * TINY_S)
    spin = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    for part in held:
        T = way @ get_part_pose(world, data, part)
        move_part(world, data, part, T)
        v = world.dof[part]
        # v = v_frame + spin x lever; MuJoCo has the spin of a free body in the frame of the body.
        data.qvel[v : v + 3] = speed + cross(spin, T[:3, 3] - after[:3, 3])
        data.qvel[v + 3 : v + 6] = T[:3, :3].T @ spin


def weld(scene: Scene, data: Any, part: str, on: bool) -> None:
    """Switch the weld of an ideal gripper: hold a part in its present pose in the hand, or release it."""
    model = scene.work.model
    weld = model.equality(f"grasp_{part}").id
    if on:
        mount = body_frame(data, model.body(f"arm/{scene.arm.mount}").id)
        T = pose.inverse(mount) @ body_frame(data, model.body(f"{part}/").id)
        # MuJoCo's data of a weld: anchor (3), relative position (3), quaternion (4), torque scale (1).
        model.eq_data[weld, :11] = (0, 0, 0, *T[:3, 3], *quaternion(T), 1)
    data.eq_active[weld] = int(on)
