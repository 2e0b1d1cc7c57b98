"""From the description of an arm to an `Arm`: its model put together, its joints driven, its gripper measured."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.resources import folder
from apo_bench.simulation.arms.apart import build_apart
from apo_bench.simulation.arms.arm import Arm, ArmLimits
from apo_bench.simulation.arms.chain import find_flange, find_joints
from apo_bench.simulation.arms.description import ArmDescription, read_description
from apo_bench.simulation.arms.home import find_home
from apo_bench.simulation.arms.loading import check_surroundings, compiled, files_of, load_model
from apo_bench.simulation.arms.measuring import Measured, measure
from apo_bench.simulation.arms.pressing import PROBE
from apo_bench.simulation.arms.servo import add_servos, drives_of, felt_inertia, is_soft
from apo_bench.simulation.arms.stated import stated_arm
from apo_bench.simulation.arms.strength import with_force

_TIP = "tip"
_GRIPPER = "gripper/"
_FINGER_ARMATURE = 1e-4
_FINGER_DAMPING = 0.02
"""Of finger joints that are neither damped nor geared, [kg m^2] and [Nm s/rad]: light links would rattle for ever."""
_USUAL_FINGERS_M_S = 0.05
"""As the hand of a Panda. Pads that meet a part at 0.28 m/s go up to 0.8 mm into it; where they overlap a wall of it by
less than that in another direction, MuJoCo pushes along that one, and the pad sticks between two walls."""
_MOST_BUILT = 8
_BUILT: dict[tuple[tuple[str, int], ...], Arm] = {}


def read_arm(path: str | Path) -> Arm:
    """The arm of an arm file, built and measured.

    Raises:
        InputError: Anything that is wrong in the file or in the models that it names.
    """
    return read_described(read_description(Path(path)))


def read_described(said: ArmDescription) -> Arm:
    """The arm of a description, as it was built and measured when its files were as they are now."""
    times = tuple((str(each), each.stat().st_mtime_ns) for each in (said.file, *_files(said)) if each.is_file())
    if times not in _BUILT:
        while len(_BUILT) >= _MOST_BUILT:
            del _BUILT[next(iter(_BUILT))]
        _BUILT[times] = build_arm(said) if _is_ours(said) else build_apart(said)
    return _BUILT[times]


def _is_ours(said: ArmDescription) -> bool:
    """Whether the models come with the package."""
    ours = os.path.realpath(folder("assets"))
    models = (said.mjcf, said.gripper.mjcf or said.mjcf)
    return all(Path(os.path.realpath(each)).is_relative_to(ours) for each in models)


def build_arm(said: ArmDescription) -> Arm:
    """Put an arm together.

    Raises:
        InputError: Its models do not fit the description, or cannot be used; what to do is said.
    """
    if said.gripper.slides is not None:
        return stated_arm(said, said.gripper.slides)
    spec = load_model(said.mjcf, "arm")
    model = compiled(spec, said.mjcf)
    check_surroundings(model, said.mjcf)
    flange, T_flange = find_flange(model, said)
    joints = find_joints(model, flange, said)
    if said.gripper.mjcf is not None:
        hand = load_model(said.gripper.mjcf, "gripper")
        hand.option = spec.option
        T = T_flange @ said.gripper.mount
        frame = spec.body(model.body(flange).name).add_frame(pos=T[:3, 3], quat=_quaternion(T))
        spec.attach(hand, frame=frame, prefix=_GRIPPER)
    elif said.gripper.mount is not None and not np.array_equal(said.gripper.mount, np.eye(4)):
        raise InputError(
            f"{said.file}, gripper: 'mount' needs 'mjcf'; a gripper that is part of the arm has its place."
        )
    last = model.body(flange).name
    _make_passive(spec, joints)
    whole = compiled(spec, said.mjcf)
    drives = drives_of(whole, joints)
    usual = _usual_home(model, joints)
    rig = _measuring_model(spec, said.mjcf)
    start = said.home if said.home is not None else usual
    if len(start) != len(joints):
        raise InputError(f"{said.file}: 'home_deg' has {len(start)} numbers; the arm has {len(joints)} joints.")
    names = said.gripper.actuators
    if names is not None and said.gripper.mjcf is not None:
        gripper = replace(said.gripper, actuators=tuple(_prefixed(rig, "actuator", name) for name in names))
    else:
        gripper = said.gripper
    if gripper.pads is not None and gripper.mjcf is not None:
        a, b = (name if _known(rig, name) else _GRIPPER + name for name in gripper.pads)
        gripper = replace(gripper, pads=(a, b))
    where = said.gripper.mjcf or said.mjcf
    flange = rig.body(last).id
    found, times = with_force(
        spec,
        said.gripper.force_n,
        said.file,
        lambda spec: measure(_measuring_model(spec, said.mjcf), where, joints, start, flange, gripper),
    )
    own = _drive(spec, whole, joints, start, drives, found, said)
    text = _text(spec, found)
    arm = Arm(
        mjcf=said.file,
        base=tuple(said.base[:3, 3].tolist()),
        turn=tuple(_quaternion(said.base).tolist()),
        joints=tuple(joints),
        tip=_TIP,
        fingers=found.hand.joints,
        grip="",
        mount=found.mount,
        home=start,
        opening_m=float(found.hand.opening[-1]),
        squeeze_m=found.hand.squeeze_m,
        model=text,
        hand=found.hand,
        limits=_limits(said, joints, drives),
        files=_files(said),
        control=("own position actuators" if own else "position servos made from the model")
        + (f", gripper drive {times:.3g} times as strong as in the model" if times != 1.0 else ""),
    )
    return arm if said.home is not None else replace(arm, home=find_home(arm))


def _make_passive(spec: Any, joints: Sequence[str]) -> None:
    """Nothing falls, nothing of the arm touches itself or what it stands on, and light finger links do not rattle."""
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            geom.contype = 1
            geom.conaffinity = 0
    standing = spec.joint(joints[0]).parent
    for body in spec.bodies:
        if body.name == standing.name or not _turns(body, joints):
            for geom in body.geoms:
                geom.contype = 0
    for joint in spec.joints:
        if joint.name not in joints and joint.armature == 0.0 and not np.any(joint.damping):
            joint.armature = _FINGER_ARMATURE
            joint.damping[0] = _FINGER_DAMPING


def _turns(body: Any, joints: Sequence[str]) -> bool:
    """Whether a joint of the arm moves a body."""
    while body is not None and body.name != "world":
        if any(joint.name in joints for joint in body.joints):
            return True
        body = body.parent
    return False


def _measuring_model(spec: Any, mjcf: Path) -> Any:
    """The arm with a part to push on, which waits far away."""
    rig = spec.copy()
    probe = rig.worldbody.add_body(name=PROBE, mocap=True, pos=(0.0, 0.0, -1.0))
    probe.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.01, 0.01, 0.01), contype=0, conaffinity=1)
    return compiled(rig, mjcf)


def _drive(
    spec: Any, model: Any, joints: Sequence[str], home: Array, drives: Any, found: Measured, said: ArmDescription
) -> bool:
    """Keep the arm's own position actuators where each is stiff and named like its joint, else make servos."""
    inertia = felt_inertia(model, joints, home)
    limits = said.torque_nm
    if limits is not None:
        if len(limits) not in (1, len(joints)):
            raise InputError(f"{said.file}: 'torque_nm' has {len(limits)} numbers; the arm has {len(joints)} joints.")
        each = np.broadcast_to(limits, len(joints))
        drives.update({name: drives[name]._replace(torque=float(x)) for name, x in zip(joints, each, strict=True)})
    names = [actuator.name for actuator in spec.actuators]
    stiff = all(not is_soft(drives[name].stiffness, felt) for name, felt in zip(joints, inertia, strict=True))
    if stiff and limits is None and all(name in names for name in joints):
        return True
    for actuator in list(spec.actuators):
        if actuator.name not in found.hand.actuators:
            spec.delete(actuator)
    add_servos(spec, joints, inertia, drives)
    return False


def _text(spec: Any, found: Measured) -> str:
    """The whole as MJCF, with the site of the tip."""
    for site in list(spec.sites):
        if site.name == _TIP:
            site.name = f"{_TIP}_of_the_model"
    T = found.T_mount_tip
    spec.body(found.mount).add_site(name=_TIP, pos=T[:3, 3], quat=_quaternion(T), size=(0.003, 0.003, 0.003), group=4)
    spec.modelname = "arm"
    spec.compile()
    return str(spec.to_xml())


def _limits(said: ArmDescription, joints: Sequence[str], drives: Any) -> ArmLimits:
    return ArmLimits(
        payload_kg=said.payload_kg,
        speed_rad_s=None if said.speed_rad_s is None else said.joint_speeds(len(joints)),
        torque_nm=np.array([drives[name].torque for name in joints]),
        fingers_m_s=said.gripper.speed_m_s or _USUAL_FINGERS_M_S,
    )


def _files(said: ArmDescription) -> tuple[Path, ...]:
    gripper = files_of(said.gripper.mjcf) if said.gripper.mjcf is not None else ()
    own = () if said.file == said.mjcf else (said.file,)
    return tuple(dict.fromkeys((*own, *files_of(said.mjcf), *gripper)))


def _usual_home(model: Any, joints: Sequence[str]) -> Array:
    """The middle of the range of each joint, or zero."""
    at = [model.joint(name).id for name in joints]
    low, high = model.jnt_range[at].T
    return np.where(model.jnt_limited[at].astype(bool), (low + high) / 2, 0.0)


def _known(model: Any, name: str) -> bool:
    bodies = {model.body(i).name for i in range(model.nbody)}
    return name in bodies or name in {model.geom(i).name for i in range(model.ngeom)}


def _prefixed(model: Any, kind: str, name: str) -> str:
    known = {getattr(model, kind)(i).name for i in range(model.nu)}
    return name if name in known else _GRIPPER + name


def _quaternion(T: Array) -> Array:
    return np.asarray(pose.pack(T)[3:])
