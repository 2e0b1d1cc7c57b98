"""What a gripper does, found by driving it: which surfaces hold, how far they open, how hard they push.

Nothing but the drive is simulated: no gravity, the arm stands still. Fingers are what moves; they close along the
direction in which two groups of them move towards each other. Of each group, what reaches farthest are the pads.
"""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.simulation.arms.description import GripperDescription
from apo_bench.simulation.arms.hand import Hand
from apo_bench.simulation.arms.pads import geom_reach, pads_of
from apo_bench.simulation.arms.pressing import PROBE_WIDE, force_of
from apo_bench.simulation.arms.rig import Rig, command_ends, frame_of, poses_after, rig_of

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
    model: Any, path: Path, joints: Sequence[str], home: Array, flange: int, said: GripperDescription
) -> Measured:
    """Drive the gripper of a compiled arm.

    Args:
        path: The file, for messages.
        joints: Of the arm; they stand still at `home`, [rad].
        flange: The body behind the gripper.

    Raises:
        InputError: There is nothing that moves, or nothing that closes; what to state is said.
    """
    rig = rig_of(model, path, joints, home, flange, said)
    ends = command_ends(rig, said)
    states = {end: poses_after(rig, np.array(end)) for end in ends}
    spread = {end: float(np.linalg.norm(c - c.mean(axis=0), axis=1).sum()) for end, c in states.items()}
    if said.open is not None and said.closed is not None:
        opened = said.open
        closed = said.closed
    else:
        opened = np.array(max(spread, key=spread.__getitem__))
        closed = np.array(min(spread, key=spread.__getitem__))
    rig.settle(closed)
    at_closed = np.array(rig.data.geom_xpos)
    frame = frame_of(rig, flange)
    seconds = rig.settle(opened)
    way = at_closed - rig.data.geom_xpos
    sides, across, ahead = pads_of(rig, said, way, flange)
    return _table(rig, sides, across, ahead, (closed, opened), seconds, frame, flange)


def _table(
    rig: Rig,
    sides: tuple[list[int], list[int]],
    across: Array,
    ahead: Array,
    ends: tuple[Array, Array],
    seconds: float,
    frame: Array,
    flange: int,
) -> Measured:
    model = rig.model
    data = rig.data
    pads = sides[0] + sides[1]
    rows = []
    reach = []
    middles = []
    turns = []
    closed, opened = ends
    for part in np.linspace(1.0, 0.0, _LEVELS):
        command = closed + part * (opened - closed)
        rig.settle(command)
        width, middle = _between(model, data, sides)
        rows.append((width / 2, command, np.array(data.qpos[model.jnt_qposadr[rig.joints]])))
        reach.append(max(geom_reach(model, data, g, ahead) for g in pads))
        middles.append(middle)
        turns.append(np.array(data.geom_xmat[pads[0]].reshape(3, 3)))
    kept = _ascending([row[0] for row in rows])
    if rows[kept[-1]][0] - max(rows[kept[0]][0], 0.0) < _LEAST_M / 2:
        raise InputError(
            f"{rig.path}: the gripper opens {2e3 * rows[0][0]:.1f} mm; {1e3 * _LEAST_M:g} mm are needed, so check "
            "'open' and 'closed', or name its 'pads'."
        )
    longest = max(reach)
    half = kept[len(kept) // 2]
    side = np.cross(ahead, across)
    centre = np.mean([data.geom_xpos[g] for g in pads], axis=0)
    at = (middles[half] @ across) * across + (centre @ side) * side + (longest - _BEYOND_M) * ahead
    mount = _mount(model, pads, flange)
    R_mount = data.xmat[mount].reshape(3, 3)
    T = np.eye(4)
    T[:3, :3] = R_mount.T @ np.column_stack([across, side, ahead])
    T[:3, 3] = R_mount.T @ (at - data.xpos[mount])
    left = sides[0][0]
    right = sides[1][0]
    apart = abs(float((data.geom_xpos[left] - data.geom_xpos[right]) @ across))
    thick = apart - 2 * rows[-1][0]
    table = [rows[i] for i in kept]
    force, squeeze, friction = force_of(rig, at, np.column_stack([across, side, ahead]), table)
    apart = abs(float((data.geom_xpos[left] - data.geom_xpos[right]) @ across)) - thick
    hand = Hand(
        actuators=tuple(model.actuator(int(a)).name for a in rig.actuators),
        joints=tuple(model.joint(int(j)).name for j in rig.joints),
        opening=np.array([rows[i][0] for i in kept]),
        commands=np.array([rows[i][1] for i in kept]),
        states=np.array([rows[i][2] for i in kept]),
        force_n=force,
        squeeze_m=squeeze,
        gives_m=max(0.0, PROBE_WIDE * rows[kept[-1]][0] - apart / 2),
        turns_deg=_angle(turns[min(kept, key=lambda i: abs(rows[i][0] - rows[kept[-1]][0] / 2))], turns[kept[-1]]),
        friction=friction,
        pads=(model.geom(left).name, model.geom(right).name),
        thick_m=thick,
        seconds=seconds + _STROKE_S,
        reach=np.array([reach[i] - longest + _BEYOND_M for i in kept]),
    )
    return Measured(hand, model.body(mount).name, T)


def _angle(one: Array, other: Array) -> float:
    """Between two rotations, [deg]."""
    return float(np.degrees(np.arccos(np.clip((np.sum(one * other) - 1.0) / 2.0, -1.0, 1.0))))


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
    chains = []
    for g in pads:
        body = int(model.geom_bodyid[g])
        chain = []
        while body:
            chain.append(body)
            body = int(model.body_parentid[body])
        chains.append(chain)
    mount = next(body for body in chains[0] if all(body in chain for chain in chains))
    while not model.body_jntnum[mount] and mount != flange:
        parent = int(model.body_parentid[mount])
        if model.body_jntnum[parent] or parent == 0:
            break
        mount = parent
    return mount
