"""Measure a gripper by driving it, and write its gripper file.

    python -m benchmarks.measure_gripper ARM.xml [--flange NAME] [--gripper GRIPPER.xml] > assets/grippers/NAME.toml

Only the drive is simulated: no gravity, the arm stands still. Fingers are what moves; they close along the direction in
which two groups of them move towards each other. The pads of a group are what reaches farthest. Where each pad pushes
with less than 10 N, the file states by how much its drive has to be stronger for 20 N.

The file is long because each number of a gripper file has its own measurement, and a benchmark is one script.
"""

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Ints, pose
from apo_bench.simulation.arms.arm import Hand
from apo_bench.simulation.arms.building import make_passive, mount_gripper, usual_home
from apo_bench.simulation.arms.chain import find_flange, find_joints
from apo_bench.simulation.arms.description import ArmDescription, GripperDescription
from apo_bench.simulation.arms.grooves import fill_grooves
from apo_bench.simulation.arms.hands import scale_drive
from apo_bench.simulation.arms.loading import compile_model, load_model
from apo_bench.simulation.arms.shapes import below, geom_reach
from apo_bench.simulation.frames import frame, quaternion
from apo_bench.simulation.physics import physics

STEP_S = 0.001
LONGEST_S = 1.5
_STILL = 2e-3
_QUIET = 20
"""Longest time of one command; joints slower than the second rest after so many steps."""
_HEAVY = 10.0
"""[kg m^2]"""
_MOST_ACTUATORS = 4


class Rig(NamedTuple):
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

    def settle(self, command: Array, most_s: float = LONGEST_S) -> float:
        """Drive until nothing moves; returns how long it took, [s]."""
        model = self.model
        data = self.data
        data.ctrl[self.actuators] = command
        dof = model.jnt_dofadr[self.joints]
        quiet = 0
        steps = 0
        most = round(most_s / STEP_S)
        while steps < most and quiet < _QUIET:
            steps += 1
            mujoco.mj_step(model, data)
            data.qpos[self.arm] = self.home
            data.qvel[self.arm_dof] = 0.0
            quiet = quiet + 1 if np.abs(data.qvel[dof]).max() < _STILL else 0
        require(
            np.isfinite(data.qpos).all() and not data.warning.number.any(),
            f"{self.path}: the gripper is unstable when it is driven; correct its actuators or masses.",
        )
        mujoco.mj_kinematics(model, data)
        return STEP_S * steps

    def steady(self) -> None:
        """Make the arm heavy: one of light links chatters where it is held still step by step."""
        self.model.dof_armature[self.arm_dof] += _HEAVY
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))


def rig_of(model: Any, path: Path, joints: Sequence[str], home: Array, flange: int) -> Rig:
    """The model made ready: hard contacts and no gravity.

    Raises:
        InputError: Nothing of the gripper moves, or what moves it is not known.
    """
    arm = [model.joint(name).id for name in joints]
    hanging = below(model, flange)
    own = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in hanging and j not in arm]
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    require(
        len(own) > 1 and all(int(model.jnt_type[j]) in scalar for j in own),
        f"{path}: two sides of the gripper must move, on hinges or slides.",
    )
    model.opt.timestep = STEP_S
    model.opt.gravity[:] = 0.0
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    hard = physics(STEP_S)
    model.geom_solref[:] = hard.solref
    model.geom_solimp[:] = hard.solimp
    model.opt.cone = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
    model.opt.impratio = hard.impratio
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET) | int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    data = mujoco.MjData(model)
    at = model.jnt_qposadr[arm]
    data.qpos[at] = home
    mujoco.mj_forward(model, data)
    actuators = _actuators(model, data, path, own)
    return Rig(model, data, at, model.jnt_dofadr[arm], home, actuators, np.array(own), path)


def _actuators(model: Any, data: Any, path: Path, own: Sequence[int]) -> Ints:
    """Those that push a joint of the gripper."""
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    pushes = np.abs(moment[:, [int(model.jnt_dofadr[j]) for j in own]]).max(axis=1, initial=0.0) > 0.0
    pushing: Ints = np.flatnonzero(pushes)
    require(0 < len(pushing) <= _MOST_ACTUATORS, f"{path}: {len(pushing)} actuators move the gripper; 1 to 4 can be.")
    return pushing


def command_ends(rig: Rig) -> list[tuple[float, ...]]:
    """Every combination of the ends of the commands."""
    limited = rig.model.actuator_ctrllimited[rig.actuators]
    require(limited.all(), f"{rig.path}: the command of an actuator of the gripper has no range; state 'ctrlrange'.")
    return list(product(*rig.model.actuator_ctrlrange[rig.actuators].tolist()))


_MOVES_M = 0.001
"""What moves less is no finger."""
_TIP_M = 0.012
"""What ends within this of the farthest end is of a pad."""
_SNAP = float(np.cos(np.radians(1.0)))
_SNAP_AHEAD = float(np.cos(np.radians(10.0)))
"""A direction so near to an axis of the flange is meant as that axis."""


def pads_of(rig: Rig, way: Array, flange: int) -> tuple[tuple[list[int], list[int]], Array, Array]:
    """The pads of both sides, by geom; the closing direction and the way ahead, unit vectors, world."""
    model = rig.model
    data = rig.data
    hanging = below(model, flange)
    touching = [
        g
        for g in range(model.ngeom)
        if int(model.geom_bodyid[g]) in hanging and (model.geom_contype[g] or model.geom_conaffinity[g])
    ]
    moving = [g for g in touching if np.linalg.norm(way[g]) > _MOVES_M]
    require(len(moving) >= 2, f"{rig.path}: nothing of the gripper moves between its ends of command.")
    # The direction in which the motions of all shapes are largest in the mean square: the first right singular vector.
    across = np.linalg.svd(way[moving], full_matrices=False)[2][0]
    first = [g for g in moving if way[g] @ across > 0.3 * np.linalg.norm(way[g])]
    second = [g for g in moving if way[g] @ across < -0.3 * np.linalg.norm(way[g])]
    require(first and second, f"{rig.path}: the fingers do not close on each other.")
    R_flange = data.xmat[flange].reshape(3, 3)
    across = _snap(across, R_flange, _SNAP)
    middle = np.mean([data.geom_xpos[g] for g in first + second], axis=0) - data.xpos[flange]
    ahead = middle - (middle @ across) * across
    require(
        np.linalg.norm(ahead) >= 1e-3,
        f"{rig.path}: the fingers do not reach ahead of the flange.",
    )
    ahead = _snap(ahead / np.linalg.norm(ahead), R_flange, _SNAP_AHEAD)
    most = max(geom_reach(model, data, g, ahead) for g in first + second)
    first = [g for g in first if geom_reach(model, data, g, ahead) > most - _TIP_M]
    second = [g for g in second if geom_reach(model, data, g, ahead) > most - _TIP_M]
    require(first and second, f"{rig.path}: one finger is longer than the other.")
    return (first, second), across, ahead


def _snap(direction: Array, R: Array, near: float) -> Array:
    """An axis of a frame where a direction is as good as that, else the direction."""
    along = R.T @ direction
    k = int(np.abs(along).argmax())
    return np.asarray(np.sign(along[k]) * R[:, k] if abs(along[k]) > near else direction)


PROBE = "probe"
"""The body between the pads on which their force is measured; it stands elsewhere until then."""
PROBE_WIDE = 0.5
"""How wide it is, as a part of the opening."""
_AWAY_M = 1.0
_SQUEEZES_M = (0.03, 0.015, 0.008, 0.004, 0.002, 0.001)
_MOST_N = 60.0
"""How far inside a part fingers are sent at most: less where they press harder than this."""
_PROBE_HIGH_M = 0.006
_STEPS = 16
_SLOWLY_S = 0.02
_LOOKS = 100
"""Half of its height, about the tip; in how many steps a gripper is closed on it, and how long each takes; steps over
which the force is averaged."""


class Press(NamedTuple):
    """What two pads do to a part between them."""

    force_n: float
    """Of each, the mean of both."""
    friction: float


def force_of(rig: Rig, at: Array, R: Array, openings: Array, commands: Array) -> tuple[Press, float]:
    """How hard the pads push on a part between them, and how far inside it they are sent for that, [m].

    Farther means harder where the drive is soft; it is not more than a part should be pressed by.
    """
    model = rig.model
    data = rig.data
    opened = commands[-1]
    body = model.body(PROBE).id
    geom = int(model.body_geomadr[body])
    half = np.array([PROBE_WIDE * float(openings[-1]), 0.02, _PROBE_HIGH_M])
    model.geom_size[geom] = half
    model.geom_rbound[geom] = float(np.linalg.norm(half))
    model.geom_aabb[geom, 3:] = half
    mocap = int(model.body_mocapid[body])
    data.mocap_pos[mocap] = (0.0, 0.0, -_AWAY_M)
    press, squeeze = Press(0.0, 0.0), 0.0
    for squeeze in _SQUEEZES_M:
        rig.settle(opened)
        data.mocap_pos[mocap] = at
        data.mocap_quat[mocap] = quaternion(R)
        closed = np.array([np.interp(half[0] - squeeze, openings, column) for column in commands.T])
        press = _press(rig, geom, opened, closed, R[:, 0])
        data.mocap_pos[mocap] = (0.0, 0.0, -_AWAY_M)
        if press.force_n <= _MOST_N:
            break
    return press, squeeze


def _press(rig: Rig, probe: int, opened: Array, closed: Array, across: Array) -> Press:
    data = rig.data
    for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
        rig.settle(opened + part * (closed - opened), _SLOWLY_S)
    rig.settle(closed)
    total = 0.0
    rubs = 0.0
    wrench = np.zeros(6)
    for _ in range(_LOOKS):
        rig.settle(closed, STEP_S)
        for c in range(data.ncon):
            mujoco.mj_contactForce(rig.model, data, c, wrench)
            push = abs(float(wrench[0] * (data.contact[c].frame[:3] @ across)))
            pad = next(int(g) for g in data.contact[c].geom if g != probe)
            total += push
            rubs += push * float(rig.model.geom_friction[pad, 0])
    return Press(total / 2 / _LOOKS, round(rubs / total, 6) if total else 0.0)


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


def measure(model: Any, path: Path, joints: Sequence[str], home: Array, last: str) -> Measured:
    """Drive the gripper of a compiled arm.

    Args:
        path: The file, for messages.
        joints: Of the arm; they stand still at `home`, [rad].
        last: The body behind the gripper.

    Raises:
        InputError: There is nothing that moves, or nothing that closes.
    """
    flange = model.body(last).id
    rig = rig_of(model, path, joints, home, flange)
    widths = {}
    longest = 0.0
    for command in command_ends(rig):
        longest = max(longest, rig.settle(np.array(command)))
        bodies = rig.data.xipos[model.jnt_bodyid[rig.joints]]
        widths[command] = float(np.linalg.norm(bodies - bodies.mean(axis=0), axis=1).sum())
    if longest >= LONGEST_S:
        rig.steady()
    opened = np.array(max(widths, key=widths.__getitem__))
    closed = np.array(min(widths, key=widths.__getitem__))
    rig.settle(closed)
    at_closed = np.array(rig.data.geom_xpos)
    seconds = rig.settle(opened)
    sides, across, ahead = pads_of(rig, at_closed - rig.data.geom_xpos, flange)
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
            f"{rig.path}: the gripper opens {2e3 * levels[0].opening:.1f} mm; {1e3 * _LEAST_M:g} mm are needed."
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


LEAST_FORCE_N = 10.0
"""Of each pad: below it parts slip."""
USUAL_FORCE_N = 20.0
"""As the usual arm; of a drive that is made stronger."""
_NEAR = 0.02
_TRIES = 5


def measure_scaled(spec: Any, measured: Callable[[Any], Measured]) -> tuple[Measured, float]:
    """Measure a gripper, and make its drive stronger where it hardly pushes; returns how many times as strong."""
    found = measured(spec)
    times = 1.0
    for _ in range(_TRIES if found.hand.force_n < LEAST_FORCE_N else 0):
        by = USUAL_FORCE_N / max(found.hand.force_n, 0.01)
        scale_drive(spec, found.hand.actuators, by)
        times *= by
        found = measured(spec)
        if abs(found.hand.force_n - USUAL_FORCE_N) <= _NEAR * USUAL_FORCE_N:
            break
    return found, times


def gripper_file(mjcf: Path, flange: str | None, gripper: Path | None) -> str:
    """The gripper file of the gripper of an arm, as TOML."""
    described = GripperDescription(hand="measured", mjcf=None if gripper is None else str(gripper.absolute()))
    arm = ArmDescription(schema="apo-bench/arm/1", file=mjcf, mjcf=mjcf.name, flange=flange, gripper=described)
    spec = load_model(mjcf, "arm")
    model = compile_model(spec, mjcf)
    body, T_flange = find_flange(model, arm)
    joints = find_joints(model, body, arm)
    last = model.body(body).name
    mount_gripper(spec, last, T_flange, arm)
    make_passive(spec, joints)
    fill_grooves(spec, joints)

    def measured(spec: Any) -> Measured:
        with_probe = spec.copy()
        probe = with_probe.worldbody.add_body(name=PROBE, mocap=True, pos=(0.0, 0.0, -1.0))
        probe.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.01, 0.01, 0.01), contype=0, conaffinity=1)
        return measure(compile_model(with_probe, mjcf), gripper or mjcf, joints, usual_home(model, joints), last)

    found, times = measure_scaled(spec, measured)
    hand = found.hand
    T = pose.pack(found.T_mount_tip)
    lines = [
        'schema = "apo-bench/gripper/1"',
        *([] if found.mount == last else [f"mount = {_names([found.mount])[1:-1]}"]),
    ]
    lines += [f"tip = {{ at_mm = {_row(1e3 * T[:3])}, quaternion_wxyz = {_row(T[3:])} }}"]
    lines += [f"{key} = {_names(names)}" for key, names in (("actuators", hand.actuators), ("joints", hand.joints))]
    lines += [
        f"pads = {_names(hand.pads)}",
        f"pads_apart_mm = {1e3 * hand.thick_m:.6g}",
        f"force_n = {hand.force_n:.6g}",
    ]
    lines += [f"squeeze_mm = {1e3 * hand.squeeze_m:g}", f"friction = {hand.friction:g}", f"seconds = {hand.seconds:g}"]
    lines += [f"drive_scale = {times:.6g}", f"opening_mm = {_row(1e3 * hand.opening)}"]
    lines += [
        f"{key} = [{', '.join(map(_row, rows))}]"
        for key, rows in (("commands", hand.commands), ("states", hand.states))
    ]
    return "\n".join(lines) + "\n"


def _row(numbers: Iterable[float]) -> str:
    return f"[{', '.join(f'{x:.9g}' for x in numbers)}]"


def _names(names: Iterable[str]) -> str:
    quoted = (f'"{name.removeprefix("gripper/")}"' for name in names)
    return f"[{', '.join(quoted)}]"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("arm", type=Path, help="MJCF file of the arm")
    asked.add_argument("--flange", help="its site or body where the gripper begins")
    asked.add_argument("--gripper", type=Path, help="MJCF file of the gripper, if that is another one")
    given = asked.parse_args()
    sys.stdout.write(gripper_file(given.arm, given.flange, given.gripper))


if __name__ == "__main__":
    main()
