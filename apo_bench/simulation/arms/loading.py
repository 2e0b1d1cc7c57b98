"""MJCF files of arms and grippers, read by MuJoCo and stripped of what a scene has of its own.

From a description that states its gripper to an `Arm`: the model is used as it is.
"""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError, one_line, require, require_known
from apo_bench.geometry import pose
from apo_bench.simulation.arms.allowed import MOST_MESH_BYTES
from apo_bench.simulation.arms.arm import Arm, ArmDescription, ArmLimits, SlideGripper
from apo_bench.simulation.arms.tree import checked_size, read_model_tree

_LONGEST = 200
_LARGEST_BASE_M = 0.5
_NAMED = ("bodies", "joints", "geoms", "sites", "actuators")


def load_model(path: Path, kind: str) -> Any:
    """An MJCF file as `MjSpec`, without sensors, key frames, cameras, lights and pictures of its own.

    Every body, joint, geom, site and actuator has a name in it. Shapes that touch nothing are left out where they are
    meshes, which would have to be compiled with every scene. How it is simulated is left to the scene.

    Args:
        kind: What the file should be, for the message: `arm`, `gripper`.

    Raises:
        InputError: There is no such file, it says what it may not, MuJoCo cannot read it, or a mesh is missing.
    """
    tree = read_model_tree(path, kind)
    try:
        spec = mujoco.MjSpec.from_string(tree.text)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot read this MJCF file of the {kind}: {_reason(error)}.") from error
    _check_world(spec, path, kind)
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH and not geom.contype and not geom.conaffinity:
            spec.delete(geom)
    _keep_meshes(spec, path, kind)
    for plural in _NAMED:
        for i, each in enumerate(getattr(spec, plural)):
            if not each.name:
                each.name = f"{plural[:-1]}_{i}"
    return spec


def compiled(spec: Any, path: Path) -> Any:
    """The model of what was read.

    Raises:
        InputError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot compile this: {_reason(error)}; mend the file.") from error


def files_of(path: Path) -> tuple[Path, ...]:
    """A file of an arm, with the files that it includes and the meshes that it names."""
    try:
        return tuple(dict.fromkeys(read_model_tree(path, "arm").files))
    except InputError:
        return (path,)


def _check_world(spec: Any, path: Path, kind: str) -> None:
    """One thing, of hinges and slides, that nothing ties to the world."""
    for joint in spec.joints:
        require(
            joint.type in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE),
            f"{path}: the joint '{joint.name}' of the {kind} neither turns nor slides; arms have hinges, and "
            "grippers hinges and slides.",
        )
    moving = [body.name for body in spec.worldbody.bodies if body.find_all("joint")]
    require(
        len(moving) <= 1,
        f"{path}: the {kind} has {len(moving)} bodies that move on their own ({', '.join(moving[:4])}); give one.",
    )
    for equality in spec.equalities:
        holds = equality.type in (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT)
        bodies = {equality.name1, equality.name2} if equality.objtype == mujoco.mjtObj.mjOBJ_BODY else set()
        require(
            not holds or not bodies & {"", "world"},
            f"{path}: the equality '{equality.name}' ties something to the world; remove it, the arm moves.",
        )


def check_surroundings(model: Any, path: Path) -> None:
    """Raise an `InputError` if what stands fast in the file of an arm reaches farther than a base does."""
    first = int(model.jnt_bodyid[0]) if model.njnt else 0
    at = model.body_pos[model.body_rootid[first]][:2]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if not touches or model.body_weldid[model.geom_bodyid[geom]]:
            continue
        is_plane = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
        R = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + R @ model.geom_aabb[geom, :3]
        half = np.abs(R) @ model.geom_aabb[geom, 3:]
        reach = float(np.linalg.norm(np.abs(middle[:2] - at) + half[:2]))
        if is_plane or reach > _LARGEST_BASE_M:
            raise InputError(
                f"{path}: the geom '{model.geom(geom).name}' stands fast and reaches farther than "
                f"{_LARGEST_BASE_M:g} m from the arm; remove it, what is around the arm belongs to the scenario."
            )


def _keep_meshes(spec: Any, path: Path, kind: str) -> None:
    """Meshes that something touches by."""
    used = {geom.meshname for geom in spec.geoms if geom.meshname}
    size = 0
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
        elif mesh.file:
            file = Path(mesh.file)
            require(
                file.is_file(),
                f"{path}: the mesh file {one_line(str(file), _LONGEST)} of the {kind} is missing; bring it there.",
            )
            size += checked_size(file, kind)
    require(
        size <= MOST_MESH_BYTES,
        f"{path}: the meshes that touch something have {size / 1e6:.0f} MB; {MOST_MESH_BYTES / 1e6:g} are the most.",
    )


def _reason(error: Exception) -> str:
    """What MuJoCo says, in one line."""
    return one_line(" ".join(str(error).split()).rstrip("."), _LONGEST)


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
        mjcf=file,
        base=tuple(description.base[:3, 3].tolist()),
        turn=tuple(pose.pack(description.base)[3:].tolist()),
        joints=tuple(joints),
        tip=slides.tip,
        fingers=slides.joints,
        grip=grip,
        mount=flange,
        home=description.home,
        opening_m=slides.opening_m,
        model=read_model_tree(description.mjcf, "arm").text,
        limits=ArmLimits(
            payload_kg=description.payload_kg,
            speed_rad_s=description.of_each_joint("speed_deg_s", description.speed_rad_s, len(joints)),
            fingers_m_s=description.gripper.speed_m_s or ArmLimits.fingers_m_s,
        ),
        files=tuple(dict.fromkeys((file, *files_of(description.mjcf)))),
    )
