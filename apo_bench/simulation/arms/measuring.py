"""What a gripper does, found by driving it: which surfaces hold, how far they open, how hard they push.

Nothing but the drive is simulated: no gravity, the arm stands still. Fingers are what moves; they close along the
direction in which two groups of them move towards each other. Of each group, what reaches farthest are the pads.
"""

from __future__ import annotations

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
from apo_bench.simulation.scene.physics import physics
from apo_bench.simulation.scene.world import Ints

PROBE = "probe"
"""The body between the pads on which their force is measured; it stands elsewhere until then."""
_LEVELS, _QUIET = 17, 20
"""Commands that are tried between closed and open; steps after which what has not moved rests."""
_STEP_S, _LONGEST_S, _STILL = 0.001, 1.5, 2e-3
_MOST_ACTUATORS = 4
_MOVES_M, _TIP_M, _LEAST_M = 0.001, 0.012, 0.004
"""What moves less than the first is no finger; what ends within the second of the farthest end is of a pad; grippers
that open less than the third do not count."""
_BEYOND_M = 0.01
"""So far the pads reach beyond the tip."""
_FAR_M = 1.0
_SNAP = np.cos(np.radians(1.0))
_PROBE = 0.5
"""How wide the part is on which the force is measured, as a part of the opening."""
_SQUEEZES_M, _MOST_N = (0.03, 0.015, 0.008, 0.004), 60.0
"""How far inside a part fingers are sent at most: less where they press harder than this."""
_PROBE_HIGH_M, _STROKE_S, _SLOWLY_S, _LOOKS = 0.006, 0.1, 0.02, 100
"""Half of its height, about the tip; so much longer than to open a gripper may take to close; how long each of the
steps takes in which it is closed on the part; steps over which the force is averaged."""


class Measured(NamedTuple):
    """A gripper that was driven."""

    hand: Hand
    mount: str
    """The body that carries the fingers."""
    T_mount_tip: Array
    """The tip in the mount: z ahead, x along the closing direction, (4, 4), [m]."""


class _Rig(NamedTuple):
    """A model in which only the gripper moves."""

    model: Any
    data: Any
    arm: Ints
    """Addresses of the arm's joints in `qpos`."""
    arm_dof: Ints
    home: Array
    actuators: Ints
    joints: Ints
    path: Path

    def settle(self, command: Array, most_s: float = _LONGEST_S) -> float:
        """Drive until nothing moves; returns how long it took, [s]."""
        model, data = self.model, self.data
        data.ctrl[self.actuators] = command
        dof = model.jnt_dofadr[self.joints]
        quiet = 0
        steps, most = 0, round(most_s / _STEP_S)
        while steps < most and quiet < _QUIET:
            steps += 1
            mujoco.mj_step(model, data)
            data.qpos[self.arm], data.qvel[self.arm_dof] = self.home, 0.0
            quiet = quiet + 1 if np.abs(data.qvel[dof]).max() < _STILL else 0
        if not np.isfinite(data.qpos).all() or data.warning.number.any():
            raise InputError(f"{self.path}: the gripper is unstable when it is driven; mend its actuators or masses.")
        mujoco.mj_kinematics(model, data)
        return _STEP_S * steps


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
    rig = _rig(model, path, joints, home, flange, said)
    ends = _ends(rig, said)
    states = {end: _poses(rig, np.array(end)) for end in ends}
    spread = {end: float(np.linalg.norm(c - c.mean(axis=0), axis=1).sum()) for end, c in states.items()}
    if said.open is not None and said.closed is not None:
        opened, closed = said.open, said.closed
    else:
        opened, closed = np.array(max(spread, key=spread.__getitem__)), np.array(min(spread, key=spread.__getitem__))
    rig.settle(closed)
    at_closed, frame = np.array(rig.data.geom_xpos), _frame_of(rig, flange)
    seconds = rig.settle(opened)
    way = at_closed - rig.data.geom_xpos
    sides, across, ahead = _sides(rig, said, way, flange)
    return _table(rig, sides, across, ahead, (closed, opened), seconds, frame, flange)


def _rig(model: Any, path: Path, joints: Sequence[str], home: Array, flange: int, said: GripperDescription) -> _Rig:
    arm = [model.joint(name).id for name in joints]
    below = _below(model, flange)
    own = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in below and j not in arm]
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    if not own or any(int(model.jnt_type[j]) not in scalar for j in own):
        what = "no joint" if not own else "a joint that neither turns nor slides"
        raise InputError(
            f"{path}: the gripper has {what}; give its MJCF in 'gripper', with hinges or slides and what drives them."
        )
    model.opt.timestep, model.opt.gravity[:] = _STEP_S, 0.0
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    hard = physics(_STEP_S)
    model.geom_solref[:], model.geom_solimp[:] = hard.solref, hard.solimp
    model.opt.cone, model.opt.impratio = int(mujoco.mjtCone.mjCONE_ELLIPTIC), hard.impratio
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET) | int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    data = mujoco.MjData(model)
    at = np.array([model.jnt_qposadr[j] for j in arm])
    data.qpos[at] = home
    mujoco.mj_forward(model, data)
    actuators = _actuators(model, data, path, own, said)
    return _Rig(model, data, at, np.array([model.jnt_dofadr[j] for j in arm]), home, actuators, np.array(own), path)


def _actuators(model: Any, data: Any, path: Path, own: Sequence[int], said: GripperDescription) -> Ints:
    """Those that are named, or that push a joint of the gripper."""
    if said.actuators is not None:
        known = [model.actuator(i).name for i in range(model.nu)]
        if missing := [name for name in said.actuators if name not in known]:
            raise InputError(f"{path}: there is no actuator '{missing[0]}'; known are {', '.join(known) or 'none'}.")
        return np.array([model.actuator(name).id for name in said.actuators])
    moment = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    pushes = np.abs(moment[:, [int(model.jnt_dofadr[j]) for j in own]]).max(axis=1, initial=0.0) > 0.0
    found: Ints = np.flatnonzero(pushes)
    if not 0 < len(found) <= _MOST_ACTUATORS:
        raise InputError(
            f"{path}: {len(found)} actuators move the gripper; name the 1 to {_MOST_ACTUATORS} that open it in "
            "'gripper', 'actuators'."
        )
    return found


def _ends(rig: _Rig, said: GripperDescription) -> list[tuple[float, ...]]:
    """Every combination of the ends of the commands."""
    for given in (said.open, said.closed):
        if given is not None and len(given) != len(rig.actuators):
            raise InputError(
                f"{rig.path}, gripper: 'open' and 'closed' have one number for each of {len(rig.actuators)} actuators."
            )
    if said.open is not None and said.closed is not None:
        return [tuple(said.open), tuple(said.closed)]
    model = rig.model
    ranges = []
    for a in rig.actuators:
        low, high = model.actuator_ctrlrange[a]
        if not model.actuator_ctrllimited[a]:
            name = model.actuator(int(a)).name
            raise InputError(
                f"{rig.path}: the command of the actuator '{name}' has no range; state 'open' and 'closed' in "
                "'gripper'."
            )
        ranges.append((float(low), float(high)))
    return list(product(*ranges))


def _poses(rig: _Rig, command: Array) -> Array:
    """Where the shapes of the gripper are after a command, (k, 3), [m]."""
    rig.settle(command)
    bodies = rig.model.jnt_bodyid[rig.joints]
    return np.array(rig.data.xipos[bodies])


def _sides(
    rig: _Rig, said: GripperDescription, way: Array, flange: int
) -> tuple[tuple[list[int], list[int]], Array, Array]:
    """The pads of both sides, by geom; the closing direction and the way ahead, unit vectors, world."""
    model, data = rig.model, rig.data
    below = _below(model, flange)
    touching = [
        g
        for g in range(model.ngeom)
        if int(model.geom_bodyid[g]) in below and (model.geom_contype[g] or model.geom_conaffinity[g])
    ]
    moving = [g for g in touching if np.linalg.norm(way[g]) > _MOVES_M]
    if said.pads is not None:
        named = [[g for g in touching if _is(model, g, name)] for name in said.pads]
        for name, found in zip(said.pads, named, strict=True):
            if not found:
                raise InputError(f"{rig.path}, gripper: nothing that could touch a part is called '{name}'.")
        moving = named[0] + named[1]
    if len(moving) < 2:
        raise InputError(
            f"{rig.path}: nothing of the gripper moves between its ends of command; state 'open' and 'closed'."
        )
    _, _, axes = np.linalg.svd(way[moving], full_matrices=False)
    across = axes[0]
    first = [g for g in moving if way[g] @ across > 0.3 * np.linalg.norm(way[g])]
    second = [g for g in moving if way[g] @ across < -0.3 * np.linalg.norm(way[g])]
    if said.pads is not None:
        first, second = named
    if not first or not second:
        raise InputError(f"{rig.path}: the fingers do not close on each other; name both 'pads' in 'gripper'.")
    across = _snapped(across, _frame_of(rig, flange)[:3, :3])
    middle = np.mean([data.geom_xpos[g] for g in first + second], axis=0) - data.xpos[flange]
    ahead = middle - (middle @ across) * across
    if np.linalg.norm(ahead) < 1e-3:
        raise InputError(f"{rig.path}: the fingers do not reach ahead of the flange; check 'mount' in 'gripper'.")
    ahead = _snapped(ahead / np.linalg.norm(ahead), _frame_of(rig, flange)[:3, :3], np.cos(np.radians(10.0)))
    if said.pads is None:
        most = max(_reach(model, data, g, ahead) for g in first + second)
        first = [g for g in first if _reach(model, data, g, ahead) > most - _TIP_M]
        second = [g for g in second if _reach(model, data, g, ahead) > most - _TIP_M]
    if not first or not second:
        raise InputError(f"{rig.path}: one finger is longer than the other; name both 'pads' in 'gripper'.")
    return (first, second), across, ahead


def _table(
    rig: _Rig,
    sides: tuple[list[int], list[int]],
    across: Array,
    ahead: Array,
    ends: tuple[Array, Array],
    seconds: float,
    frame: Array,
    flange: int,
) -> Measured:
    model, data, pads = rig.model, rig.data, sides[0] + sides[1]
    rows, reach, middles = [], [], []
    closed, opened = ends
    for part in np.linspace(1.0, 0.0, _LEVELS):
        command = closed + part * (opened - closed)
        rig.settle(command)
        width, middle = _between(model, data, sides)
        rows.append((width / 2, command, np.array(data.qpos[model.jnt_qposadr[rig.joints]])))
        reach.append(max(_reach(model, data, g, ahead) for g in pads))
        middles.append(middle)
    kept = _ascending([row[0] for row in rows])
    if rows[kept[-1]][0] - max(rows[kept[0]][0], 0.0) < _LEAST_M / 2:
        raise InputError(
            f"{rig.path}: the gripper opens {2e3 * rows[0][0]:.1f} mm; {1e3 * _LEAST_M:g} mm are needed, so check "
            "'open' and 'closed', or name its 'pads'."
        )
    longest, half = max(reach), kept[len(kept) // 2]
    side = np.cross(ahead, across)
    centre = np.mean([data.geom_xpos[g] for g in pads], axis=0)
    at = (middles[half] @ across) * across + (centre @ side) * side + (longest - _BEYOND_M) * ahead
    mount = _mount(model, pads, flange)
    R_mount = data.xmat[mount].reshape(3, 3)
    T = np.eye(4)
    T[:3, :3] = R_mount.T @ np.column_stack([across, side, ahead])
    T[:3, 3] = R_mount.T @ (at - data.xpos[mount])
    left, right = sides[0][0], sides[1][0]
    apart = abs(float((data.geom_xpos[left] - data.geom_xpos[right]) @ across))
    thick = apart - 2 * rows[-1][0]
    table = [rows[i] for i in kept]
    force, squeeze = _force(rig, at, np.column_stack([across, side, ahead]), table)
    apart = abs(float((data.geom_xpos[left] - data.geom_xpos[right]) @ across)) - thick
    hand = Hand(
        actuators=tuple(model.actuator(int(a)).name for a in rig.actuators),
        joints=tuple(model.joint(int(j)).name for j in rig.joints),
        opening=np.array([rows[i][0] for i in kept]),
        commands=np.array([rows[i][1] for i in kept]),
        states=np.array([rows[i][2] for i in kept]),
        force_n=force,
        squeeze_m=squeeze,
        gives_m=max(0.0, _PROBE * rows[kept[-1]][0] - apart / 2),
        friction=max(float(model.geom_friction[g, 0]) for g in pads),
        pads=(model.geom(left).name, model.geom(right).name),
        thick_m=thick,
        seconds=seconds + _STROKE_S,
        reach=np.array([reach[i] - longest + _BEYOND_M for i in kept]),
    )
    return Measured(hand, model.body(mount).name, T)


def _ascending(openings: Sequence[float]) -> list[int]:
    """Rows from closed to open that open more and more; measured from open to closed."""
    kept: list[int] = []
    for i in range(len(openings) - 1, -1, -1):
        if not kept or openings[i] > openings[kept[-1]] + 1e-5:
            kept.append(i)
    return kept


def _force(rig: _Rig, at: Array, R: Array, table: Sequence[tuple[float, Array, Array]]) -> tuple[float, float]:
    """How hard each pad pushes on a part between them, [N], and how far inside it they are sent for that, [m].

    Farther means harder where the drive is soft; it is not more than a part should be pressed by.
    """
    model, data = rig.model, rig.data
    opening, opened = table[-1][0], table[-1][1]
    body = model.body(PROBE).id
    geom = int(model.body_geomadr[body])
    half = np.array([_PROBE * opening, 0.02, _PROBE_HIGH_M])
    model.geom_size[geom], model.geom_rbound[geom] = half, float(np.linalg.norm(half))
    model.geom_aabb[geom, 3:] = half
    mocap = int(model.body_mocapid[body])
    data.mocap_pos[mocap] = (0.0, 0.0, -_FAR_M)
    force = squeeze = 0.0
    for squeeze in _SQUEEZES_M:
        rig.settle(opened)
        data.mocap_pos[mocap] = at
        mujoco.mju_mat2Quat(data.mocap_quat[mocap], np.ascontiguousarray(R).ravel())
        wanted, openings = half[0] - squeeze, [row[0] for row in table]
        closed = np.array([np.interp(wanted, openings, column) for column in np.array([row[1] for row in table]).T])
        force = _pressed(rig, opened, closed, R[:, 0])
        data.mocap_pos[mocap] = (0.0, 0.0, -_FAR_M)
        if force <= _MOST_N:
            break
    return force, squeeze


def _pressed(rig: _Rig, opened: Array, closed: Array, across: Array) -> float:
    """The mean force of a pad while it presses, [N]."""
    data = rig.data
    for part in np.linspace(0.0, 1.0, _LEVELS)[1:]:
        rig.settle(opened + part * (closed - opened), _SLOWLY_S)
    rig.settle(closed)
    total, wrench = 0.0, np.zeros(6)
    for _ in range(_LOOKS):
        rig.settle(closed, _STEP_S)
        for c in range(data.ncon):
            mujoco.mj_contactForce(rig.model, data, c, wrench)
            total += abs(float(wrench[0] * (data.contact[c].frame[:3] @ across)))
    return total / 2 / _LOOKS


def _between(model: Any, data: Any, sides: tuple[list[int], list[int]]) -> tuple[float, Array]:
    """The width between the pads, [m], and the middle of it, (3,), world."""
    least, middle, line = np.inf, np.zeros(3), np.zeros(6)
    for a, b in product(*sides):
        width = mujoco.mj_geomDistance(model, data, a, b, _FAR_M, line)
        if width < least:
            least, middle = width, (line[:3] + line[3:]) / 2
    return float(least), middle


def _reach(model: Any, data: Any, geom: int, ahead: Array) -> float:
    """How far the box around a geom reaches along a direction, world, [m]."""
    along = data.geom_xmat[geom].reshape(3, 3).T @ ahead
    centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    return float(data.geom_xpos[geom] @ ahead + centre @ along + half @ np.abs(along))


def _mount(model: Any, pads: Sequence[int], flange: int) -> int:
    """The body behind all fingers, and what is fixed to it, but for the last link of the arm."""
    chains = []
    for g in pads:
        body, chain = int(model.geom_bodyid[g]), []
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


def _below(model: Any, body: int) -> set[int]:
    """A body and what hangs on it."""
    found = {body}
    for b in range(body + 1, model.nbody):
        if int(model.body_parentid[b]) in found:
            found.add(b)
    return found


def _is(model: Any, geom: int, name: str) -> bool:
    """Whether a geom, or a body that it is fixed to, has a name."""
    return name in (model.geom(geom).name, model.body(int(model.geom_bodyid[geom])).name)


def _frame_of(rig: _Rig, body: int) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rig.data.xmat[body].reshape(3, 3), rig.data.xpos[body]
    return T


def _snapped(direction: Array, R: Array, near: float = float(_SNAP)) -> Array:
    """An axis of a frame where a direction is as good as that, else the direction."""
    along = R.T @ direction
    k = int(np.abs(along).argmax())
    return np.asarray(np.sign(along[k]) * R[:, k] if abs(along[k]) > near else direction)
