"""The corrector `physics-settle`: correct observed poses by letting the parts come to rest in a simulation.

For each operation the main part, with what it carries, is put at its observed pose. Then everything moves under gravity
and contact, in the same soft contacts as replays, until it rests. The corrected pose is that of the main part, and all
parts stay where they came to rest. During the first `SOFT_S` all motion is strongly damped, so that parts that
penetrate separate slowly instead of jumping.

The simulation uses neither the contacts nor the covariances of the observation. Fit faces recede by the play that the
observation states, or by `CLEARANCE_M`; all parts have the same density.
"""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from apo_bench.assembly import Correction, Observation
from apo_bench.geometry import Array, Solid, pose, shrink_pieces
from apo_bench.records import describe_outcome
from apo_bench.simulation.physics import Physics, physics, set_contact, set_options
from apo_bench.simulation.scene.geoms import add_pieces, set_mass
from apo_bench.simulation.scene.world import World, get_part_pose, has_failed, make_initial_state, set_part_pose, world

CLEARANCE_M = 0.25e-3
"""Play per side of fit faces if none is stated; without any play parts cannot be joined."""
_DENSITY = 600.0  # [kg/m^3], of wood, as in the part files
_FRICTION = 0.8  # coefficient of sliding, of wood
SOFT_S = 0.3  # motion is strongly damped from the start of an operation for this time
_LONGEST_S = 1.5  # longest simulation of an operation
_REST_S = 0.05  # an operation ends after rest of this duration
_SYRUP = 200.0
"""Strong damping, [1/s], with which a part falls at 5 cm/s."""
_SLOW = np.repeat([1e-3, np.radians(1.0)], 3)
"""Speed below which a part rests, [m/s, rad/s]."""
_SLOW.flags.writeable = False


def settle(observation: Observation) -> Correction | Array:
    """Correct an observation to the poses at which the parts come to rest.

    Returns:
        (n, 4, 4), world frame, [m], if everything was observed; from the operation on at which the simulation becomes
        unstable, the observed poses. Otherwise a `Correction` with status `not_seen` and unknown gaps.
    """
    if not observation.observed.all():
        missing = int(np.argmin(observation.observed))  # the first operation that was not observed
        return Correction(
            observation.poses, "not_seen", describe_outcome("not_seen", operation=missing), (), np.nan, np.nan, 0
        )
    goals = np.array(observation.poses)
    if not len(goals):
        return goals
    scene = _world(observation)
    data = make_initial_state(scene, observation.start)
    for k, operation in enumerate(observation.assembly.operations):
        _put(scene, data, operation.moves, observation.poses[k])
        try:
            _rest(scene, data)
        except mujoco.FatalError:
            break
        if has_failed(data):
            break
        goals[k] = get_part_pose(scene, data, operation.main)
    return goals


def _put(scene: World, data: mujoco.MjData, moves: tuple[str, ...], T: Array) -> None:
    """Put the main part, `moves[0]`, at T, (4, 4), at rest, together with the parts that it carries."""
    before = pose.inverse(get_part_pose(scene, data, moves[0]))
    for part in moves:
        set_part_pose(scene, data, part, T @ before @ get_part_pose(scene, data, part))


def _rest(scene: World, data: mujoco.MjData) -> None:
    """Simulate until no part has moved for `_REST_S`, at most `_LONGEST_S`."""
    model = scene.model
    began = data.time
    quiet = 0.0
    # (parts, 6): velocity indices of the free joints; `inertia` has masses and principal inertias in that order.
    dof = np.array(list(scene.dof.values()))[:, None] + np.arange(6)
    mujoco.mj_forward(model, data)
    inertia = np.array([[model.body_mass[b]] * 3 + [*model.body_inertia[b]] for b in map(scene.body.get, scene.free)])
    while data.time - began < _LONGEST_S and quiet < _REST_S and not has_failed(data):
        soft = data.time - began < SOFT_S
        model.dof_damping[dof] = _SYRUP * inertia if soft else 0.0
        mujoco.mj_step(model, data)
        still = not soft and bool((np.abs(data.qvel[dof]) < _SLOW).all())
        quiet = quiet + model.opt.timestep if still else 0.0


def _world(observation: Observation) -> World:
    """Compile the parts of an assembly without room and arm; parts that no operation moves are fixed."""
    moved = {part for operation in observation.assembly.operations for part in operation.moves}
    free = tuple(part for part in observation.assembly.solids if part in moved)
    fixed = tuple(part for part in observation.assembly.solids if part not in moved)
    spec = _room(observation.assembly.solids, free, observation.play_m or CLEARANCE_M, physics())
    model = spec.compile()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return world(model, free, fixed)


def _room(solids: Mapping[str, Solid], free: tuple[str, ...], clearance_m: float, s: Physics) -> Any:
    """The `MjSpec` of the parts, with fit faces receded by the clearance."""
    spec = mujoco.MjSpec()
    set_options(spec.option, s)
    set_contact([spec.default.geom], s)
    surface = {"friction": (_FRICTION, 0.005, 0.0001), "density": _DENSITY, "condim": s.condim}
    for part, solid in solids.items():
        body = spec.worldbody.add_body(name=f"{part}/")
        if part in free:
            body.add_freejoint()
        set_mass(body, solid, _DENSITY)
        add_pieces(spec, body, shrink_pieces(solid, clearance_m), surface, f"{part}/")
    return spec
