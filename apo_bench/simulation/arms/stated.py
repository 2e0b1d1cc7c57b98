"""Make the arm of a description that states its gripper: the model is used as it is."""

from typing import Any

import mujoco

from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import pose
from apo_bench.simulation.arms.arm import Arm, ArmLimits
from apo_bench.simulation.arms.description import ArmDescription, SlideGripper
from apo_bench.simulation.arms.loading import files_of


def stated_arm(description: ArmDescription, slides: SlideGripper, model: Any, joints: list[str], flange: str) -> Arm:
    """The arm of a file whose gripper is stated.

    Args:
        model: As its MJCF file says it, compiled.
        joints: The hinges between base and flange.
        flange: The body at the end of the arm.

    Raises:
        InputError: Its model has not what the file names, or something is not stated that nothing else tells.
    """
    file = description.file
    if description.home is None or len(description.home) != len(joints):
        raise InputError(f"{file}: 'home_deg' needs {len(joints)} numbers, one for each joint of the arm.")
    require(
        description.torque_nm is None, f"{file}: 'torque_nm' is for an arm whose gripper is measured; leave it out."
    )
    (grip, *more) = description.gripper.actuators or ("",)
    require(not more, f"{file}, gripper: one of 'actuators' drives all 'slides'; {1 + len(more)} were given.")
    require_known("site", slides.tip, [model.site(i).name for i in range(model.nsite)], place=file)
    sliding = [
        model.joint(j).name for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    ]
    for name in slides.joints:
        require_known("slide", name, sliding, place=file)
    actuators = [model.actuator(i).name for i in range(model.nu)]
    for name in (*joints, grip):
        require_known("actuator", name, actuators, place=file)
    return Arm(
        mjcf=description.mjcf,
        base=tuple(description.base[:3, 3].tolist()),
        turn=tuple(pose.pack(description.base)[3:].tolist()),
        joints=tuple(joints),
        tip=slides.tip,
        fingers=slides.joints,
        grip=grip,
        mount=flange,
        home=description.home,
        opening_m=slides.opening_m,
        limits=ArmLimits(
            payload_kg=description.payload_kg,
            speed_rad_s=description.of_each_joint("speed_deg_s", description.speed_rad_s, len(joints)),
            fingers_m_s=description.gripper.speed_m_s or ArmLimits.fingers_m_s,
        ),
        files=tuple(dict.fromkeys((file, *files_of(description.mjcf)))),
    )
