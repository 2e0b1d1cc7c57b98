"""Build an `Arm` from its description: mount the gripper, find joints and pads, choose a home, add servos."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.arm import Arm, ArmLimits, Hand
from apo_bench.simulation.arms.chain import find_flange, find_joints
from apo_bench.simulation.arms.description import ArmDescription, read_description
from apo_bench.simulation.arms.gripper_file import read_gripper
from apo_bench.simulation.arms.grooves import fill_grooves
from apo_bench.simulation.arms.hands import check_names, find_pad, scale_drive
from apo_bench.simulation.arms.home import with_home
from apo_bench.simulation.arms.loading import compile_model, load_model
from apo_bench.simulation.arms.servo import Drive, add_servos, drives_of, is_soft, joint_inertia
from apo_bench.simulation.arms.sliding_gripper import COUPLED_SOLIMP, COUPLED_SOLREF, drive_sliding_gripper
from apo_bench.simulation.arms.stated import model_files, speed_limits, stated_arm

_TIP = "tip"
_GRIPPER = "gripper/"
_FINGER_ARMATURE = 1e-4  # [kg m^2]
_FINGER_DAMPING = 0.02  # [Nm s/rad]
"""Added to finger joints that have neither, since their light links would vibrate without end."""
_DEFAULT_SOLREF = (0.02, 1.0)  # MuJoCo's default, with which they yield 1 mm to a few newtons
_USUAL_FINGERS_MM_S = 50.0
"""Default speed of each finger, as the hand of a Panda.

Pads that meet a part at 0.28 m/s penetrate up to 0.8 mm. If they overlap another wall of the part by less, MuJoCo
pushes them off that one, and the pad sticks between two walls.
"""
_MOST_BUILT = 8  # arms in the cache
_BUILT: dict[tuple[tuple[str, int], ...], Arm] = {}
"""Cache: (path, time of change) of each file of an arm -> the arm."""


@check_arguments
def read_arm(path: str | Path) -> Arm:
    """Read an arm from a TOML file that describes any MJCF arm with a gripper of two sides.

    Args:
        path: The arm file; `docs/guide/arm.md` lists its keys.

    Raises:
        InputError: A fault of the file or of the models that it names.

    Examples:
        >>> import apo_bench
        >>> from apo_bench.resources import folder
        >>> apo_bench.read_arm(folder("assets") / "arms" / "six_axis.toml").tip
        'tip'
    """
    return read_described(read_description(Path(path)))


def read_described(description: ArmDescription) -> Arm:
    """The arm of a description, from the cache if its files have not changed."""
    times = tuple((str(each), each.stat().st_mtime_ns) for each in model_files(description) if each.is_file())
    if times not in _BUILT:
        while len(_BUILT) >= _MOST_BUILT:
            del _BUILT[next(iter(_BUILT))]
        _BUILT[times] = build_arm(description)
    return _BUILT[times]


def build_arm(description: ArmDescription) -> Arm:
    """Build an arm with a gripper file; an arm with stated slides is used as it is.

    Raises:
        InputError: Its models do not match the description, or cannot be used.
    """
    mjcf = description.model_file
    spec = load_model(mjcf, "arm")
    model = compile_model(spec, mjcf)
    flange, T_flange = find_flange(model, description)
    joints = find_joints(model, flange, description)
    last = model.body(flange).name
    if description.gripper.slides:
        return stated_arm(description, model, joints, last)
    mount_gripper(spec, last, T_flange, description)
    make_passive(spec, joints)
    fill_grooves(spec, joints)
    whole = compile_model(spec, mjcf)
    drives = drives_of(whole, joints)
    home = usual_home(model, joints) if description.home_deg is None else np.radians(description.home_deg)
    require(
        len(home) == len(joints),
        f"{description.file}: 'home_deg' has {len(home)} numbers; the arm has {len(joints)} joints.",
    )
    gripper = _fit_gripper(spec, whole, last, description)
    hand = gripper.hand
    base = pose.pack(description.base_frame)
    arm = Arm(
        mjcf=description.file,
        base=tuple(base[:3].tolist()),
        turn=tuple(base[3:].tolist()),
        joints=tuple(joints),
        tip=_TIP,
        fingers=hand.joints,
        grip="",
        mount=gripper.mount,
        home=home,
        opening_m=float(hand.opening[-1]),
        squeeze_m=hand.squeeze_m,
        model=_with_tip(spec, gripper.mount, gripper.T_tip),
        hand=hand,
        limits=ArmLimits(
            payload_kg=description.payload_kg,
            speed_rad_s=speed_limits(description, len(joints)),
            torque_nm=np.array([drives[name].torque for name in joints]),
            fingers_m_s=1e-3 * (description.gripper.speed_mm_s or _USUAL_FINGERS_MM_S),
        ),
        files=model_files(description),
    )
    if description.home_deg is None:
        arm = with_home(arm, description.base is not None)
    own = _drive(spec, joints, joint_inertia(whole, joints, arm.home), drives, hand.actuators, description)
    spec.compile()
    control = "own position actuators" if own else "position servos made from the model"
    scale = gripper.scale
    stronger = f", gripper drive {scale:.3g} times as strong as in the model" if scale != 1.0 else ""
    return replace(arm, model=str(spec.to_xml()), control=control + stronger)


class _Gripper(NamedTuple):
    """The gripper of an arm."""

    hand: Hand
    mount: str
    """The body that carries it."""
    T_tip: Array
    """(4, 4), the tip in the mount."""
    scale: float = 1.0
    """Strength of its drive, as a multiple of that in the model."""


def _fit_gripper(spec: Any, model: Any, last: str, description: ArmDescription) -> _Gripper:
    """Return the gripper that a gripper file describes, else the sliding fingers of the model, with its drive changed.

    Args:
        model: The compiled model of `spec`.
        last: The last body of the arm.
    """
    file = description.hand_file
    if file is None:
        hand, T_tip = drive_sliding_gripper(spec, model, last, description)
        return _Gripper(hand, last, T_tip)
    table = read_gripper(file)
    prefix = "" if description.gripper_file is None else _GRIPPER
    left, right = (find_pad(model, prefix + name, file) for name in table.pads)
    hand = table.hand(prefix, (left, right))
    mount = last if table.mount is None else prefix + table.mount
    check_names(model, hand, mount, file)
    scale_drive(spec, hand.actuators, table.drive_scale)
    return _Gripper(hand, mount, table.tip_frame(file), table.drive_scale)


def _with_tip(spec: Any, mount: str, T: Array) -> str:
    """Add the site of the tip to the model and return it as MJCF text.

    Args:
        mount: The body that carries the gripper.
        T: (4, 4), the tip in that body.
    """
    for site in list(spec.sites):
        if site.name == _TIP:
            site.name = f"{_TIP}_of_the_model"
    spec.body(mount).add_site(name=_TIP, pos=T[:3, 3], quat=_quaternion(T), size=(0.003, 0.003, 0.003), group=4)
    spec.modelname = "arm"
    spec.compile()
    return str(spec.to_xml())


def mount_gripper(spec: Any, flange: str, T_flange: Array, description: ArmDescription) -> None:
    """Attach the gripper of another file to the flange.

    Args:
        flange: The last body of the arm.
        T_flange: (4, 4), the flange in that body.
    """
    if description.gripper_file is not None:
        hand = load_model(description.gripper_file, "gripper")
        hand.option = spec.option
        T = T_flange @ description.gripper.mount.matrix
        spec.attach(hand, frame=spec.body(flange).add_frame(pos=T[:3, 3], quat=_quaternion(T)), prefix=_GRIPPER)
    elif not np.array_equal(description.gripper.mount.matrix, np.eye(4)):
        raise InputError(
            f"{description.file}, gripper: 'mount' needs 'mjcf'; a gripper that is part of the arm has its place."
        )


def make_passive(spec: Any, joints: Sequence[str]) -> None:
    """Change the model so that only contacts with parts and the drives act on the arm.

    Gravity is compensated, the arm does not collide with itself or its base, and undriven finger joints are damped.
    """
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_JOINT and tuple(equality.solref) == _DEFAULT_SOLREF:
            equality.solref[:] = COUPLED_SOLREF
            equality.solimp[:] = COUPLED_SOLIMP
    for body in spec.bodies[1:]:
        body.gravcomp = 1.0
    for geom in spec.geoms:
        if geom.contype or geom.conaffinity:
            # With conaffinity 0 two geoms of the arm never collide.
            geom.contype = 1
            geom.conaffinity = 0
    # The body of the first joint, and all bodies that no joint moves, collide with nothing.
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


def _drive(
    spec: Any,
    joints: Sequence[str],
    inertia: Array,
    drives: dict[str, Drive],
    kept: Sequence[str],
    description: ArmDescription,
) -> bool:
    """Keep the arm's own position actuators if each is stiff and named like its joint, else replace them by servos.

    Args:
        inertia: (joints,), at each joint, [kg m^2].
        drives: Drive of each joint; torques of the description are entered into it.
        kept: Actuators of the gripper, which stay.

    Returns:
        Whether the arm's own actuators are kept.
    """
    torques = description.of_each_joint("torque_nm", len(joints))
    if torques is not None:
        drives.update({name: drives[name]._replace(torque=float(x)) for name, x in zip(joints, torques, strict=True)})
    names = [actuator.name for actuator in spec.actuators]
    stiff = all(not is_soft(drives[name].stiffness, J) for name, J in zip(joints, inertia, strict=True))
    if stiff and torques is None and all(name in names for name in joints):
        return True
    for actuator in list(spec.actuators):
        if actuator.name not in kept:
            spec.delete(actuator)
    add_servos(spec, joints, inertia, drives)
    return False


def usual_home(model: Any, joints: Sequence[str]) -> Array:
    """The middle of the range of each joint, or zero without limits, (joints,), [rad]."""
    at = [model.joint(name).id for name in joints]
    low, high = model.jnt_range[at].T
    return np.where(model.jnt_limited[at].astype(bool), (low + high) / 2, 0.0)


def _quaternion(T: Array) -> Array:
    """The rotation of a pose as a quaternion, w first."""
    return np.asarray(pose.pack(T)[3:])
