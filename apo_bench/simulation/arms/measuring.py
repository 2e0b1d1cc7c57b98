"""Measure a gripper by driving it: which surfaces hold, how far they open, how hard they push.

Only the drive is simulated: no gravity, the arm stands still. Fingers are what moves; they close along the direction in
which two groups of them move towards each other. The pads of a group are what reaches farthest.
"""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.simulation.arms.arm import Hand
from apo_bench.simulation.arms.description import GripperDescription
from apo_bench.simulation.arms.pads import pads_of
from apo_bench.simulation.arms.pressing import force_of
from apo_bench.simulation.arms.rig import LONGEST_S, Rig, command_ends, rig_of
from apo_bench.simulation.arms.shapes import below, geom_reach
from apo_bench.simulation.frames import frame

_LEVELS = 17
_LEAST_M = 0.004
_FAR_M = 1.0
"""Commands that are tried between closed and open; grippers that open less do not count; farther is not looked."""
_BEYOND_M = 0.01
"""So far the pads reach beyond the tip."""
_STROKE_S = 0.1
"""So much longer than to open a gripper may take to close."""


class Measured(NamedTuple):
    """A gripper that was driven."""

    hand: Hand
    mount: str
    """The body that carries the fingers."""
    T_mount_tip: Array
    """The tip in the mount: z ahead, x along the closing direction, (4, 4), [m]."""


def measure(
    model: Any, path: Path, joints: Sequence[str], home: Array, last: str, gripper: GripperDescription
) -> Measured:
    """Drive the gripper of a compiled arm.

    Args:
        path: The file, for messages.
        joints: Of the arm; they stand still at `home`, [rad].
        last: The body behind the gripper.

    Raises:
        InputError: There is nothing that moves, or nothing that closes; what to state is gripper.
    """
    flange = model.body(last).id
    rig = rig_of(model, path, joints, home, flange, gripper)
    widths = {}
    longest = 0.0
    for command in command_ends(rig, gripper):
        longest = max(longest, rig.settle(np.array(command)))
        bodies = rig.data.xipos[model.jnt_bodyid[rig.joints]]
        widths[command] = float(np.linalg.norm(bodies - bodies.mean(axis=0), axis=1).sum())
    if longest >= LONGEST_S:
        rig.steady()
    opened = np.array(gripper.open or max(widths, key=widths.__getitem__))
    closed = np.array(gripper.closed or min(widths, key=widths.__getitem__))
    rig.settle(closed)
    at_closed = np.array(rig.data.geom_xpos)
    seconds = rig.settle(opened)
    sides, across, ahead = pads_of(rig, gripper, at_closed - rig.data.geom_xpos, flange)
    return _table(rig, sides, across, ahead, (closed, opened), seconds, flange)


class _Level(NamedTuple):
    """The gripper at one command."""

    opening: float
    command: Array
    joints: Array
    reach: float
    """How far the pads reach ahead, world, [m]."""
    middle: Array
    """Between the pads, (3,), world, [m]."""


def _table(
    rig: Rig,
    sides: tuple[list[int], list[int]],
    across: Array,
    ahead: Array,
    ends: tuple[Array, Array],
    seconds: float,
    flange: int,
) -> Measured:
    model = rig.model
    data = rig.data
    pads = sides[0] + sides[1]
    levels = []
    closed, opened = ends
    for part in np.linspace(1.0, 0.0, _LEVELS):
        command = closed + part * (opened - closed)
        rig.settle(command)
        width, middle = _between(model, data, sides)
        joints = np.array(data.qpos[model.jnt_qposadr[rig.joints]])
        reach = max(geom_reach(model, data, g, ahead) for g in pads)
        levels.append(_Level(width / 2, command, joints, reach, middle))
    table = [levels[i] for i in _ascending([level.opening for level in levels])]
    widest = table[-1].opening
    if widest - max(table[0].opening, 0.0) < _LEAST_M / 2:
        raise InputError(
            f"{rig.path}: the gripper opens {2e3 * levels[0].opening:.1f} mm; {1e3 * _LEAST_M:g} mm are needed, so "
            "check 'open' and 'closed', or name its 'pads'."
        )
    # The tip lies between the pads as they are at half of the table, in the middle of what they are wide, and short of
    # where they reach farthest.
    longest = max(level.reach for level in levels)
    side = np.cross(ahead, across)
    R = np.column_stack([across, side, ahead])
    centre = np.mean([data.geom_xpos[g] for g in pads], axis=0)
    between = table[len(table) // 2].middle
    at = (between @ across) * across + (centre @ side) * side + (longest - _BEYOND_M) * ahead
    mount = _mount(model, pads, flange)
    R_mount = data.xmat[mount].reshape(3, 3)
    T = frame(R_mount.T @ R, R_mount.T @ (at - data.xpos[mount]))
    left = sides[0][0]
    right = sides[1][0]
    apart = abs(float((data.geom_xpos[left] - data.geom_xpos[right]) @ across))
    thick = apart - 2 * levels[-1].opening
    openings = np.array([level.opening for level in table])
    commands = np.array([level.command for level in table])
    press, squeeze = force_of(rig, at, R, openings, commands)
    hand = Hand(
        actuators=tuple(model.actuator(int(a)).name for a in rig.actuators),
        joints=tuple(model.joint(int(j)).name for j in rig.joints),
        opening=openings,
        commands=commands,
        states=np.array([level.joints for level in table]),
        force_n=press.force_n,
        squeeze_m=squeeze,
        friction=press.friction,
        pads=(model.geom(left).name, model.geom(right).name),
        thick_m=thick,
        seconds=seconds + _STROKE_S,
    )
    return Measured(hand, model.body(mount).name, T)


def _ascending(openings: Sequence[float]) -> list[int]:
    """Rows from closed to open that open more and more; measured from open to closed."""
    kept: list[int] = []
    for i in range(len(openings) - 1, -1, -1):
        if not kept or openings[i] > openings[kept[-1]] + 1e-5:
            kept.append(i)
    return kept


def _between(model: Any, data: Any, sides: tuple[list[int], list[int]]) -> tuple[float, Array]:
    """The width between the pads, [m], and the middle of it, (3,), world."""
    least = np.inf
    middle = np.zeros(3)
    line = np.zeros(6)
    for a, b in product(*sides):
        width = mujoco.mj_geomDistance(model, data, a, b, _FAR_M, line)
        if width < least:
            least = width
            middle = (line[:3] + line[3:]) / 2
    return float(least), middle


def _mount(model: Any, pads: Sequence[int], flange: int) -> int:
    """The body behind all fingers, and what is fixed to it, but for the last link of the arm."""
    mount = int(model.geom_bodyid[pads[0]])
    bodies = {int(model.geom_bodyid[g]) for g in pads}
    while not bodies <= below(model, mount):
        mount = int(model.body_parentid[mount])
    while not model.body_jntnum[mount] and mount != flange:
        parent = int(model.body_parentid[mount])
        if model.body_jntnum[parent] or parent == 0:
            break
        mount = parent
    return mount
