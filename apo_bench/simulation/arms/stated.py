"""From a description that states its gripper to an `Arm`: the model is used as it is."""

from pathlib import Path
from typing import Any

import mujoco

from apo_bench.errors import InputError, unknown
from apo_bench.geometry import pose
from apo_bench.simulation.arms.arm import Arm, ArmLimits
from apo_bench.simulation.arms.chain import find_flange, find_joints
from apo_bench.simulation.arms.description import ArmDescription, SlideGripper
from apo_bench.simulation.arms.loading import check_surroundings, compiled, files_of, load_model
from apo_bench.simulation.arms.tree import read_model_tree


def stated_arm(said: ArmDescription, slides: SlideGripper) -> Arm:
    """The arm of a file whose gripper is stated.

    Raises:
        InputError: Its model has not what the file names, or something is not stated that nothing else tells.
    """
    model = compiled(load_model(said.mjcf, "arm"), said.mjcf)
    check_surroundings(model, said.mjcf)
    flange, _ = find_flange(model, said)
    joints = find_joints(model, flange, said)
    if said.home is None or len(said.home) != len(joints):
        raise InputError(f"{said.file}: 'home_deg' needs {len(joints)} numbers, one for each joint of the arm.")
    if said.torque_nm is not None:
        raise InputError(f"{said.file}: 'torque_nm' is for an arm whose gripper is measured; leave it out.")
    (grip, *more) = said.gripper.actuators or ("",)
    if more:
        raise InputError(f"{said.file}, gripper: one of 'actuators' drives all 'slides'; {1 + len(more)} were given.")
    _check_names(model, said.file, joints, slides, grip)
    return Arm(
        mjcf=said.file,
        base=tuple(said.base[:3, 3].tolist()),
        turn=tuple(pose.pack(said.base)[3:].tolist()),
        joints=tuple(joints),
        tip=slides.tip,
        fingers=slides.joints,
        grip=grip,
        mount=model.body(flange).name,
        home=said.home,
        opening_m=slides.opening_m,
        model=read_model_tree(said.mjcf, "arm").text,
        limits=ArmLimits(
            payload_kg=said.payload_kg,
            speed_rad_s=None if said.speed_rad_s is None else said.joint_speeds(len(joints)),
            fingers_m_s=said.gripper.speed_m_s or ArmLimits.fingers_m_s,
        ),
        files=tuple(dict.fromkeys((said.file, *files_of(said.mjcf)))),
    )


def _check_names(model: Any, path: Path, joints: list[str], slides: SlideGripper, grip: str) -> None:
    """Every joint and the gripper have a position actuator, the slides slide, and the tip is a site."""
    sites = [model.site(i).name for i in range(model.nsite)]
    if slides.tip not in sites:
        raise InputError(f"{path}, gripper: {unknown('site', slides.tip, sites)}")
    sliding = [
        model.joint(j).name for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
    ]
    for name in slides.joints:
        if name not in sliding:
            raise InputError(f"{path}, gripper: {unknown('slide', name, sliding)}")
    actuators = [model.actuator(i).name for i in range(model.nu)]
    for name in (*joints, grip):
        if name not in actuators:
            raise InputError(f"{path}: {unknown('actuator', name, actuators)}")
