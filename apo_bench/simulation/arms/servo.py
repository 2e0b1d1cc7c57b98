"""Joint position control for arms that have none, or whose own is too soft.

Of every joint one position actuator: as stiff as the inertia at the joint at home allows at one natural
frequency, damped critically, limited by the torque of the joint. Gravity is compensated; the velocity of the path is
fed forward by the robot (`feedforward_command`).
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import Array

_SOFT_HZ = 15.0  # a position actuator whose joint would swing slower is too soft
_MOST_HZ = 45.0  # none is made that swings faster
_STIFF_NM = 5000.0
"""As stiff as this, [Nm/rad], where the second frequency allows it."""


class Drive(NamedTuple):
    """What moves a joint in the model as it was given."""

    stiffness: float
    """[Nm/rad] of a position actuator, else 0."""
    torque: float
    """The most it can do, [Nm]; infinite if not stated."""


def drives_of(model: Any, joints: Sequence[str]) -> dict[str, Drive]:
    """What the actuators of a model do at its joints."""
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
            stiffness = max(stiffness, -float(model.actuator_biasprm[a, 1]) * gear * gear)
            if model.actuator_forcelimited[a]:
                limit = min(limit, gear * float(np.abs(model.actuator_forcerange[a]).max()))
            elif not stiffness and not model.actuator_biasprm[a].any() and model.actuator_ctrllimited[a]:
                most = float(np.abs(model.actuator_ctrlrange[a]).max())
                limit = min(limit, gear * abs(float(model.actuator_gainprm[a, 0])) * most)
        if model.jnt_actfrclimited[j]:
            limit = min(limit, float(np.abs(model.jnt_actfrcrange[j]).max()))
        drives[name] = Drive(stiffness, limit)
    return drives


def joint_inertia(model: Any, joints: Sequence[str], q: Array) -> Array:
    """(joints,), the inertia at each joint alone, [kg m^2]."""
    data = mujoco.MjData(model)
    at = [model.joint(name).id for name in joints]
    data.qpos[model.jnt_qposadr[at]] = q
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M.diagonal()[model.jnt_dofadr[at]]


def stiffness_for(inertia: float) -> float:
    """The stiffness for an inertia at the joint, [Nm/rad]."""
    usual, most = ((2.0 * math.pi * hz) ** 2 * inertia for hz in (_SOFT_HZ, _MOST_HZ))
    return min(max(usual, _STIFF_NM), most)


def is_soft(stiffness: float, inertia: float) -> bool:
    """Whether a joint swings slower than it has to."""
    return stiffness < (2.0 * math.pi * _SOFT_HZ) ** 2 * inertia * 0.99


def add_servos(spec: Any, joints: Sequence[str], inertia: Array, drives: Mapping[str, Drive]) -> None:
    """One position actuator for each joint, of the same name."""
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
