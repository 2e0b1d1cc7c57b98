"""Make the arm of a description that states a gripper of slides; its model is used as it is."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Array, pose
from apo_bench.io import list_named_files
from apo_bench.simulation.arms.arm import Arm, ArmLimits
from apo_bench.simulation.arms.description import ArmDescription


def model_files(description: ArmDescription) -> tuple[Path, ...]:
    """All files that an arm is made of."""
    named = [description.file, *list_named_files(description.model_file)]
    if description.gripper_file is not None:
        named += list_named_files(description.gripper_file)
    return tuple(dict.fromkeys([*named, *([] if description.hand_file is None else [description.hand_file])]))


def speed_limits(description: ArmDescription, joints: int) -> Array | None:
    """The largest speed of each joint, (joints,), [rad/s]; None if not stated."""
    speeds = description.of_each_joint("speed_deg_s", joints)
    return None if speeds is None else np.radians(speeds)


def stated_arm(description: ArmDescription, model: Any, joints: list[str], flange: str) -> Arm:
    """The arm of a file that states a gripper of slides.

    Args:
        model: The compiled model of the arm.
        joints: The hinges between base and flange.
        flange: The last body of the arm.

    Raises:
        InputError: The model lacks what the file names, or a key is missing.
    """
    file = description.file
    gripper = description.gripper
    if description.home_deg is None or len(description.home_deg) != len(joints):
        raise InputError(f"{file}: 'home_deg' needs {len(joints)} numbers, one for each joint of the arm.")
    require(description.torque_nm is None, f"{file}: 'torque_nm' is for an arm with a gripper file; leave it out.")
    (grip,) = gripper.actuators or ("",)
    require_known("site", gripper.tip or "", [model.site(i).name for i in range(model.nsite)], place=file)
    sliding = [
        model.joint(j).name for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    ]
    for name in gripper.slides or ():
        require_known("slide", name, sliding, place=file)
    actuators = [model.actuator(i).name for i in range(model.nu)]
    for name in (*joints, grip):
        require_known("actuator", name, actuators, place=file)
    base = pose.pack(description.base_frame)
    return Arm(
        mjcf=description.model_file,
        base=tuple(base[:3].tolist()),
        turn=tuple(base[3:].tolist()),
        joints=tuple(joints),
        tip=gripper.tip or "",
        fingers=gripper.slides or (),
        grip=grip,
        mount=flange,
        home=np.radians(description.home_deg),
        opening_m=1e-3 * (gripper.opening_mm or 0.0),
        limits=ArmLimits(
            payload_kg=description.payload_kg,
            speed_rad_s=speed_limits(description, len(joints)),
            fingers_m_s=ArmLimits.fingers_m_s if gripper.speed_mm_s is None else 1e-3 * gripper.speed_mm_s,
        ),
        files=model_files(description),
    )
