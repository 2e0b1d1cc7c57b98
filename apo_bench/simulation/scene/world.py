"""A compiled model with the indices of its parts, and access to their state (`World`)."""

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
_WHEN_FELT = int(mujoco.mjtStage.mjSTAGE_ACC)  # stage of a step in which a force sensor is computed
_NEVER = int(mujoco.mjtStage.mjSTAGE_NONE)  # the same, for a sensor that is off
CLAMP = "clamp_"
"""Prefix of the name of a weld that fixes a part to another one; all other welds hold a part in a hand."""
WRIST_SENSORS = ("wrist_force", "wrist_torque")
"""Force (3,) [N] and torque (3,) [Nm] of the arm on its hand, in the frame of the mount."""


@final
@dataclass(frozen=True, eq=False)
class World:
    """A compiled model and the indices of its parts, shared by all trials of a scene.

    A trial owns only its `MjData`.
    """

    model: Any
    """`mujoco.MjModel`. Trials change weld targets before they activate a weld, and options for a while."""
    free: tuple[str, ...]
    """Movable parts, in the order of the scenario."""
    fixed: tuple[str, ...]
    body: dict[str, int]
    """Part -> body id."""
    qpos: dict[str, int]
    """Movable part -> first index of its pose in `qpos`."""
    dof: dict[str, int]
    """Movable part -> first index of its velocity in `qvel`."""
    geom_part: Ints
    """Per geom: index into free + fixed, -1 for everything else (arm, hands)."""
    grips: Ints
    """Ids of the welds that hold a part in a hand."""
    clamps: Ints
    """Ids of the welds that fix a part to another one."""


def world(model: Any, free: tuple[str, ...], fixed: tuple[str, ...]) -> World:
    """Look up the indices of all parts of a compiled model."""
    body = {part: model.body(f"{part}/").id for part in free + fixed}
    root = {body_id: i for i, body_id in enumerate(body.values())}
    geom_part = np.array([root.get(int(b), -1) for b in model.body_rootid[model.geom_bodyid]])
    welds = np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_WELD))
    is_clamp = np.array([model.equality(int(i)).name.startswith(CLAMP) for i in welds], dtype=np.bool_)
    joints = {part: int(model.body(f"{part}/").jntadr[0]) for part in free}
    return World(
        model=model,
        free=free,
        fixed=fixed,
        body=body,
        qpos={part: int(model.jnt_qposadr[j]) for part, j in joints.items()},
        dof={part: int(model.jnt_dofadr[j]) for part, j in joints.items()},
        geom_part=geom_part,
        grips=welds[~is_clamp],
        clamps=welds[is_clamp],
    )


def set_part_pose(world: World, data: Any, part: str, T: Array) -> None:
    """Set the pose of a movable part, with zero velocity."""
    move_part(world, data, part, T)
    v = world.dof[part]
    data.qvel[v : v + 6] = 0.0


def move_part(world: World, data: Any, part: str, T: Array) -> None:
    """Set the pose of a movable part; its velocity stays."""
    a = world.qpos[part]
    data.qpos[a : a + 3] = T[:3, 3]
    data.qpos[a + 3 : a + 7] = quaternion(T)


def make_initial_state(world: World, start: Poses) -> Any:
    """New `MjData` with movable parts at their start poses; fixed parts are moved in the model."""
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
    """The world pose of a movable part, (4, 4), from the position of its free joint."""
    a = world.qpos[part]
    return frame(rotation(data.qpos[a + 3 : a + 7]), data.qpos[a : a + 3])


def has_failed(data: Any) -> bool:
    """Whether MuJoCo has issued a warning, or a position is not finite."""
    return any(data.warning.number.tolist()) or not math.isfinite(data.qpos.sum())


def is_unstable(error: Exception, data: Any) -> bool:
    """Whether an error comes from a failed simulation: an error of MuJoCo, or numbers that are not finite."""
    return isinstance(error, mujoco.FatalError) or has_failed(data)


def allow_sleep(world: World, allowed: bool) -> AbstractContextManager[None]:
    """Allow, or forbid, resting parts to sleep, while the context lasts."""
    flags = int(world.model.opt.enableflags)
    return _with_option(world.model, "enableflags", flags | SLEEP if allowed else flags & ~SLEEP)


def use_timestep(model: Any, seconds: float) -> AbstractContextManager[None]:
    """Change the time step while the context lasts."""
    return _with_option(model, "timestep", seconds)


@contextmanager
def compute_only(model: Any, data: Any, sensors: list[int] | slice) -> Iterator[None]:
    """Compute only these force sensors in the steps within the context, and all others once, for its last step."""
    before = model.sensor_needstage.copy()
    model.sensor_needstage[:] = _NEVER
    model.sensor_needstage[sensors] = before[sensors]
    try:
        yield
    finally:
        model.sensor_needstage[:] = before
    mujoco.mj_sensorAcc(model, data)


@contextmanager
def switch_wrist_sensors_on(model: Any) -> Iterator[None]:
    """Compute the wrist sensors while the context lasts."""
    sensors = [model.sensor(name).id for name in WRIST_SENSORS]
    before = model.sensor_needstage[sensors]
    model.sensor_needstage[sensors] = _WHEN_FELT
    try:
        yield
    finally:
        model.sensor_needstage[sensors] = before


def disable_wrist_sensors(model: Any) -> None:
    """Compute the wrist sensors in `switch_wrist_sensors_on` only, since they make a step 5 % longer."""
    model.sensor_needstage[[model.sensor(name).id for name in WRIST_SENSORS]] = _NEVER


@contextmanager
def _with_option(model: Any, name: str, value: float) -> Iterator[None]:
    """Change one option of a model while the context lasts."""
    before = getattr(model.opt, name)
    setattr(model.opt, name, value)
    try:
        yield
    finally:
        setattr(model.opt, name, before)


def wake(world: World, data: Any) -> None:
    """Recompute everything that follows from the positions, including contacts of sleeping parts."""
    with allow_sleep(world, False):
        mujoco.mj_fwdPosition(world.model, data)


def take_snapshot(world: World, data: Any, start: Poses) -> Snapshot:
    """The present state as the judge gets it."""
    wake(world, data)
    poses = {part: get_part_pose(world, data, part) for part in world.free}
    poses.update({part: start[part] for part in world.fixed})
    a, b = _contact_parts(world, data)
    between = (a >= 0) & (b >= 0) & (a != b)  # contacts between two different parts
    return Snapshot(
        poses=poses,
        penetration_m=float(max(0.0, -np.min(data.contact.dist[between], initial=0.0))),
        speed_m_s=float(max(np.linalg.norm(data.qvel[v : v + 3]) for v in world.dof.values())),
        spin_rad_s=float(max(np.linalg.norm(data.qvel[v + 3 : v + 6]) for v in world.dof.values())),
        # No hand holds a part by a weld, and no part touches the arm or a hand, whose `geom_part` is -1.
        released=not bool(data.eq_active[world.grips].any() or ((a >= 0) != (b >= 0)).any()),
    )


def touches_others(world: World, data: Any, parts: tuple[str, ...]) -> bool:
    """Whether one of these movable parts touches a part that is not among them; contacts with the arm do not count."""
    ours = {world.free.index(part) for part in parts}
    pairs = world.geom_part[data.contact.geom].tolist()
    return any(a >= 0 and b >= 0 and (a in ours) != (b in ours) for a, b in pairs)


def _contact_parts(world: World, data: Any) -> tuple[Ints, Ints]:
    """The part index of both geoms of each contact, (k,) each, as in `World.geom_part`."""
    if data.ncon == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    geoms = data.contact.geom
    return world.geom_part[geoms[:, 0]], world.geom_part[geoms[:, 1]]
