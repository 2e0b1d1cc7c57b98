"""A compiled model and where its parts are in it."""

import math
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, final

import mujoco
import numpy as np

from apo_bench.assembly import Poses, Snapshot
from apo_bench.geometry import Array, Ints
from apo_bench.simulation.frames import frame, quaternion, rotation

SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_WHEN_FELT = int(mujoco.mjtStage.mjSTAGE_ACC)
_NEVER = int(mujoco.mjtStage.mjSTAGE_NONE)
WRIST_SENSORS = ("wrist_force", "wrist_torque")
"""What the arm exerts on its hand, (3,) [N] and (3,) [Nm], in the frame of the body that the hand begins with."""


@final
@dataclass(frozen=True, eq=False)
class World:
    """Shared by every trial of a scene; a trial owns only its `MjData`."""

    model: Any
    """`mujoco.MjModel`. Trials change its weld targets before they switch a weld on, nothing else."""
    free: tuple[str, ...]
    """Movable parts, in the order of the scenario."""
    fixed: tuple[str, ...]
    body: dict[str, int]
    """Part -> body id."""
    qpos: dict[str, int]
    dof: dict[str, int]
    geom_part: Ints
    """Per geom: index into free + fixed, -1 for everything else (arm, hands)."""


def world(model: Any, free: tuple[str, ...], fixed: tuple[str, ...]) -> World:
    """Look up every part of a compiled scene."""
    body = {part: model.body(f"{part}/").id for part in free + fixed}
    root = {body_id: i for i, body_id in enumerate(body.values())}
    geom_part = np.array([root.get(int(b), -1) for b in model.body_rootid[model.geom_bodyid]])
    joints = {part: int(model.body(f"{part}/").jntadr[0]) for part in free}
    return World(
        model=model,
        free=free,
        fixed=fixed,
        body=body,
        qpos={part: int(model.jnt_qposadr[j]) for part, j in joints.items()},
        dof={part: int(model.jnt_dofadr[j]) for part, j in joints.items()},
        geom_part=geom_part,
    )


def set_part_pose(world: World, data: Any, part: str, T: Array) -> None:
    """Put a movable part somewhere, at rest."""
    a = world.qpos[part]
    v = world.dof[part]
    data.qpos[a : a + 3] = T[:3, 3]
    data.qpos[a + 3 : a + 7] = quaternion(T)
    data.qvel[v : v + 6] = 0.0


def make_initial_state(world: World, start: Poses) -> Any:
    """New `MjData` with every movable part at its start and every fixed part at its place."""
    for part in world.fixed:
        body = world.body[part]
        world.model.body_pos[body] = start[part][:3, 3]
        world.model.body_quat[body] = quaternion(start[part])
    data = mujoco.MjData(world.model)
    for part in world.free:
        set_part_pose(world, data, part, start[part])
    mujoco.mj_forward(world.model, data)
    return data


def get_part_pose(world: World, data: Any, part: str) -> Array:
    """The pose of a movable part, (4, 4), straight from its joint."""
    a = world.qpos[part]
    return frame(rotation(data.qpos[a + 3 : a + 7]), data.qpos[a : a + 3])


def has_failed(data: Any) -> bool:
    """Whether MuJoCo has warned of anything, or a number is no longer finite."""
    return bool(data.warning.number.any()) or not math.isfinite(data.qpos.sum())


def is_unstable(error: Exception, data: Any) -> bool:
    """Whether an error is that of a simulation that has failed: of MuJoCo itself, or of numbers that are not finite."""
    return isinstance(error, mujoco.FatalError) or has_failed(data)


def allow_sleep(world: World, allowed: bool) -> AbstractContextManager[None]:
    """Let parts sleep, or not, for a while: those that rest and that nothing moves against."""
    flags = int(world.model.opt.enableflags)
    return _with_option(world.model, "enableflags", flags | SLEEP if allowed else flags & ~SLEEP)


def use_timestep(model: Any, seconds: float) -> AbstractContextManager[None]:
    """Take steps of another length for a while."""
    return _with_option(model, "timestep", seconds)


def switch_sensors_off(model: Any) -> AbstractContextManager[None]:
    """Switch all sensors off for a while."""
    return _with_option(model, "disableflags", int(model.opt.disableflags) | _NO_SENSORS)


@contextmanager
def switch_wrist_sensors_on(model: Any) -> Iterator[None]:
    """Compute the sensors of the wrist for a while, and what only they need."""
    sensors = [model.sensor(name).id for name in WRIST_SENSORS]
    before = model.sensor_needstage[sensors]
    model.sensor_needstage[sensors] = _WHEN_FELT
    try:
        yield
    finally:
        model.sensor_needstage[sensors] = before


def disable_wrist_sensors(model: Any) -> None:
    """Compute the sensors of the wrist in `switch_wrist_sensors_on` only: they make a step a twentieth longer."""
    model.sensor_needstage[[model.sensor(name).id for name in WRIST_SENSORS]] = _NEVER


@contextmanager
def _with_option(model: Any, name: str, value: float) -> Iterator[None]:
    """Give a model another value of one of its options for a while."""
    before = getattr(model.opt, name)
    setattr(model.opt, name, value)
    try:
        yield
    finally:
        setattr(model.opt, name, before)


def wake(world: World, data: Any) -> None:
    """Bring all that follows from the positions up to date, contacts of parts that were left alone too."""
    with allow_sleep(world, False):
        mujoco.mj_fwdPosition(world.model, data)


def take_snapshot(world: World, data: Any, start: Poses) -> Snapshot:
    """What the judge may see of the present state."""
    wake(world, data)
    poses = {part: get_part_pose(world, data, part) for part in world.free}
    poses.update({part: start[part] for part in world.fixed})
    a, b = _contact_parts(world, data)
    between = (a >= 0) & (b >= 0) & (a != b)
    welds = world.model.eq_type == int(mujoco.mjtEq.mjEQ_WELD)
    return Snapshot(
        poses=poses,
        penetration_m=float(max(0.0, -np.min(data.contact.dist[between], initial=0.0))),
        speed_m_s=float(max(np.linalg.norm(data.qvel[v : v + 3]) for v in world.dof.values())),
        spin_rad_s=float(max(np.linalg.norm(data.qvel[v + 3 : v + 6]) for v in world.dof.values())),
        # no weld is on, and nothing but parts touches a part
        released=not bool(data.eq_active[welds].any() or ((a >= 0) != (b >= 0)).any()),
    )


def touches_others(world: World, data: Any, parts: tuple[str, ...]) -> bool:
    """Whether any of these movable parts touches another part; that they touch each other, or the arm, is not meant."""
    ours = {world.free.index(part) for part in parts}
    pairs = zip(*(of.tolist() for of in _contact_parts(world, data)), strict=True)
    return any(a >= 0 and b >= 0 and (a in ours) != (b in ours) for a, b in pairs)


def _contact_parts(world: World, data: Any) -> tuple[Ints, Ints]:
    if data.ncon == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    geoms = data.contact.geom
    return world.geom_part[geoms[:, 0]], world.geom_part[geoms[:, 1]]
