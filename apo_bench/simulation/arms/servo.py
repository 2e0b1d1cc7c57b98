"""Joint position servos for arms without position actuators, or with soft ones.

Each joint gets one position actuator. Its stiffness follows from the inertia at the joint at home and a natural
frequency. It is critically damped and limited by the torque of the joint. Gravity is compensated; the robot feeds the
velocity of the path forward (`feedforward_command`).
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import Array

_SOFT_HZ = 15.0  # least natural frequency of a joint with its actuator
_MOST_HZ = 45.0  # largest natural frequency of a servo
_STIFF_NM = 5000.0
"""Wanted stiffness of a servo, [Nm/rad], within the stiffnesses of both frequencies."""


class Drive(NamedTuple):
    """The drive of a joint in the model as it was read."""

    stiffness: float
    """Stiffness of the position actuator, [Nm/rad]; 0 without one."""
    torque: float
    """Largest torque, [Nm]; infinite if not stated."""


def drives_of(model: Any, joints: Sequence[str]) -> dict[str, Drive]:
    """Joint -> stiffness and torque limit of its actuators in a model."""
    drives = {}
    for name in joints:
        j = model.joint(name).id
        stiffness = 0.0
        limit = math.inf
        for a in range(model.nu):
            kind = int(model.actuator_trntype[a])
            if kind != int(mujoco.mjtTrn.mjTRN_JOINT) or int(model.actuator_trnid[a, 0]) != j:
                continue
            gear = abs(float(model.actuator_gear[a, 0]))
            # biasprm[1] is -kp of a position actuator
            stiffness = max(stiffness, -float(model.actuator_biasprm[a, 1]) * gear * gear)
            if model.actuator_forcelimited[a]:
                limit = min(limit, gear * float(np.abs(model.actuator_forcerange[a]).max()))
            # A torque motor: its torque limit follows from the range of its command.
            elif not stiffness and not model.actuator_biasprm[a].any() and model.actuator_ctrllimited[a]:
                most = float(np.abs(model.actuator_ctrlrange[a]).max())
                limit = min(limit, gear * abs(float(model.actuator_gainprm[a, 0])) * most)
        if model.jnt_actfrclimited[j]:
            limit = min(limit, float(np.abs(model.jnt_actfrcrange[j]).max()))
        drives[name] = Drive(stiffness, limit)
    return drives


def joint_inertia(model: Any, joints: Sequence[str], q: Array) -> Array:
    """The inertia at each joint with all others fixed, (joints,), [kg m^2], at joint angles q."""
    data = mujoco.MjData(model)
    at = [model.joint(name).id for name in joints]
    data.qpos[model.jnt_qposadr[at]] = q
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M.diagonal()[model.jnt_dofadr[at]]


def stiffness_for(inertia: float) -> float:
    """The stiffness of a servo for an inertia at its joint, [Nm/rad]."""
    usual, most = ((2.0 * math.pi * hz) ** 2 * inertia for hz in (_SOFT_HZ, _MOST_HZ))
    return min(max(usual, _STIFF_NM), most)


def is_soft(stiffness: float, inertia: float) -> bool:
    """Whether the natural frequency of a joint is below `_SOFT_HZ`, with 1 % tolerance of the stiffness."""
    return stiffness < (2.0 * math.pi * _SOFT_HZ) ** 2 * inertia * 0.99


def add_servos(spec: Any, joints: Sequence[str], inertia: Array, drives: Mapping[str, Drive]) -> None:
    """Add a position servo of the same name for each joint."""
    for name, J in zip(joints, inertia, strict=True):
        kp = stiffness_for(float(J))
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        servo.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        # Torque kp (u - q) - kd dq on an inertia J: critical damping is kd = 2 sqrt(kp J).
        servo.gainprm[0] = kp
        servo.biasprm[:3] = (0.0, -kp, -2.0 * math.sqrt(kp * float(J)))
        if math.isfinite(drives[name].torque):
            servo.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            servo.forcerange[:] = (-drives[name].torque, drives[name].torque)
