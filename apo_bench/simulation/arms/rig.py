"""A compiled arm in which only the gripper moves: no gravity, and the arm stands still."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Ints
from apo_bench.simulation.arms.description import GripperDescription
from apo_bench.simulation.arms.shapes import below
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


def rig_of(model: Any, path: Path, joints: Sequence[str], home: Array, flange: int, gripper: GripperDescription) -> Rig:
    """The model made ready: hard contacts and no gravity.

    Raises:
        InputError: Nothing of the gripper moves, or what moves it is not known.
    """
    arm = [model.joint(name).id for name in joints]
    hanging = below(model, flange)
    own = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in hanging and j not in arm]
    scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    if not own or any(int(model.jnt_type[j]) not in scalar for j in own):
        what = "no joint" if not own else "a joint that neither turns nor slides"
        raise InputError(
            f"{path}: the gripper has {what}; give its MJCF in 'gripper', with hinges or slides and what drives them."
        )
    if len(own) == 1:
        raise InputError(
            f"{path}: one jaw of the gripper moves ('{model.joint(own[0]).name}') and the other is fixed to the hand, "
            "so parts would be pushed aside as it closes; give the MJCF of a gripper whose two sides move in 'gripper'."
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
    actuators = _actuators(model, data, path, own, gripper)
    return Rig(model, data, at, model.jnt_dofadr[arm], home, actuators, np.array(own), path)


def _actuators(model: Any, data: Any, path: Path, own: Sequence[int], gripper: GripperDescription) -> Ints:
    """Those that are named, or that push a joint of the gripper."""
    if gripper.actuators is not None:
        known = [model.actuator(i).name for i in range(model.nu)]
        if missing := [name for name in gripper.actuators if name not in known]:
            raise InputError(f"{path}: there is no actuator '{missing[0]}'; known are {', '.join(known) or 'none'}.")
        return np.array([model.actuator(name).id for name in gripper.actuators])
    moment = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    pushes = np.abs(moment[:, [int(model.jnt_dofadr[j]) for j in own]]).max(axis=1, initial=0.0) > 0.0
    pushing: Ints = np.flatnonzero(pushes)
    require(
        0 < len(pushing) <= _MOST_ACTUATORS,
        f"{path}: {len(pushing)} actuators move the gripper; name the 1 to {_MOST_ACTUATORS} that open it in "
        "'gripper', 'actuators'.",
    )
    return pushing


def command_ends(rig: Rig, gripper: GripperDescription) -> list[tuple[float, ...]]:
    """Every combination of the ends of the commands."""
    for command in (gripper.open, gripper.closed):
        require(
            command is None or len(command) == len(rig.actuators),
            f"{rig.path}, gripper: 'open' and 'closed' have one number for each of {len(rig.actuators)} actuators.",
        )
    if gripper.open is not None and gripper.closed is not None:
        return [tuple(gripper.open), tuple(gripper.closed)]
    model = rig.model
    for a in rig.actuators:
        if not model.actuator_ctrllimited[a]:
            name = model.actuator(int(a)).name
            raise InputError(
                f"{rig.path}: the command of the actuator '{name}' has no range; state 'open' and 'closed' in "
                "'gripper'."
            )
    return list(product(*model.actuator_ctrlrange[rig.actuators].tolist()))
