"""Find the gripper of two sliding fingers in the model of an arm, and drive it."""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.arm import Hand
from apo_bench.simulation.arms.description import ArmDescription
from apo_bench.simulation.arms.shapes import below, geom_reach
from apo_bench.simulation.frames import body_frame, frame

_DRIVE = "grip"  # name of the actuator
_FORCE_N = 20.0  # of each pad, unless the model limits it to less
_SQUEEZE_M = 0.03  # depth inside a part at which the drive reaches this force
_ARMATURE_KG = 0.05  # added to each finger, as in the arms that come with the benchmark
_SECONDS = 0.5  # to close or open
_TIP_M = 0.01  # of the tip behind the ends of the fingers
_ROWS = 5  # of the table of openings
_OPPOSITE = -0.99  # largest cosine between the directions in which the fingers open


class FoundGripper(NamedTuple):
    """A gripper that was found in the model of an arm."""

    hand: Hand
    T_tip: Array
    """(4, 4), the tip in the last body of the arm."""


class _Finger(NamedTuple):
    """A sliding finger."""

    joint: int
    pad: int
    """The geom that reaches farthest ahead."""
    closed: float
    open: float
    """Joint positions, [m]."""


def drive_sliding_gripper(spec: Any, model: Any, last: str, description: ArmDescription) -> FoundGripper:
    """Couple the two sliding fingers beyond the last body of an arm, and add a position actuator for both.

    Args:
        model: The compiled model of `spec`, whose fingers are not driven yet.
        last: The last body of the arm.

    Raises:
        InputError: There are not two sliding fingers that open in opposite directions.
    """
    data = mujoco.MjData(model)
    body = model.body(last).id
    mujoco.mj_kinematics(model, data)
    closing, ahead, fingers = _find_fingers(model, data, body, description)
    gaps = [_measure_gap(model, data, fingers, closing, share) for share in np.linspace(0.0, 1.0, _ROWS)]
    states = np.array([[f.closed + s * (f.open - f.closed) for f in fingers] for s in np.linspace(0.0, 1.0, _ROWS)])
    _put(model, data, fingers, 0.0)
    T_tip = pose.inverse(body_frame(data, body)) @ _find_tip(model, data, fingers, closing, ahead)
    one, other = fingers
    joints = (model.joint(one.joint).name, model.joint(other.joint).name)
    slope, offset = _couple(spec, *joints, states)
    force = min(_FORCE_N, *(_limit_force(model, f.joint) / 2.0 for f in fingers))
    _add_drive(spec, {joints[0]: 0.5, joints[1]: 0.5 / slope}, force)
    # The first row commands the closed fingers into the part.
    beyond = states[0, 0] - np.sign(one.open - one.closed) * _SQUEEZE_M
    commands = np.array([beyond, *states[:, 0]]) + 0.5 * offset / slope
    hand = Hand(
        actuators=(_DRIVE,),
        joints=joints,
        opening=np.array([gaps[0] - 1e-3, *gaps]) / 2.0,
        commands=commands[:, None],
        states=np.array([states[0], *states]),
        force_n=force,
        squeeze_m=_SQUEEZE_M,
        friction=float(model.geom_friction[one.pad, 0]),
        seconds=_SECONDS,
        pads=(model.geom(one.pad).name, model.geom(other.pad).name),
        thick_m=_measure_centres(data, fingers, closing) - gaps[0],
    )
    return FoundGripper(hand, T_tip)


def _find_fingers(
    model: Any, data: Any, body: int, description: ArmDescription
) -> tuple[Array, Array, tuple[_Finger, _Finger]]:
    """Return the direction in which the first finger opens and that ahead, (3,), world, and the fingers."""
    slides = [
        j
        for j in range(model.njnt)
        if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        and model.jnt_limited[j]
        and int(model.jnt_bodyid[j]) in below(model, body)
    ]
    geoms = [[g for g in range(model.ngeom) if int(model.geom_bodyid[g]) == model.jnt_bodyid[j]] for j in slides]
    if len(slides) != 2 or not all(geoms):
        raise InputError(
            f"{description.file}: the model has no two sliding fingers with a range and a shape beyond "
            f"'{model.body(body).name}'; name a gripper file as 'hand' in [gripper], or state 'slides'."
        )
    middles = np.array([data.geom_xpos[g].mean(axis=0) for g in geoms])
    axes = data.xaxis[slides]
    apart = middles[0] - middles[1]
    closing = axes[0] * np.sign(axes[0] @ apart)
    signs = np.sign([axes[0] @ closing, -axes[1] @ closing])
    way = middles.mean(axis=0) - data.xpos[body]
    way = way - (way @ closing) * closing
    if (signs[0] * axes[0]) @ (signs[1] * axes[1]) > _OPPOSITE or np.linalg.norm(way) < 1e-6:
        raise InputError(
            f"{description.file}: the fingers do not open in opposite directions across the way ahead; state them as "
            "'slides', 'tip', 'opening_mm' and 'actuators' in [gripper]."
        )
    ahead = way / np.linalg.norm(way)
    fingers = []
    for j, own, sign in zip(slides, geoms, signs, strict=True):
        closed, widest = model.jnt_range[j][:: int(sign)].tolist()
        fingers.append(_Finger(j, max(own, key=lambda g: geom_reach(model, data, g, ahead)), closed, widest))
    return closing, ahead, (fingers[0], fingers[1])


def _put(model: Any, data: Any, fingers: tuple[_Finger, _Finger], share: float) -> None:
    """Open the fingers by a share of their ranges."""
    for each in fingers:
        data.qpos[model.jnt_qposadr[each.joint]] = each.closed + share * (each.open - each.closed)
    mujoco.mj_kinematics(model, data)


def _measure_gap(model: Any, data: Any, fingers: tuple[_Finger, _Finger], closing: Array, share: float) -> float:
    """Return the distance of the pads at a share of the opening, [m]; negative if they overlap."""
    _put(model, data, fingers, share)
    one, other = fingers
    return -geom_reach(model, data, one.pad, -closing) - geom_reach(model, data, other.pad, closing)


def _measure_centres(data: Any, fingers: tuple[_Finger, _Finger], closing: Array) -> float:
    """Return the distance of the middles of the pads along the direction in which they close, [m]."""
    return float((data.geom_xpos[fingers[0].pad] - data.geom_xpos[fingers[1].pad]) @ closing)


def _find_tip(model: Any, data: Any, fingers: tuple[_Finger, _Finger], closing: Array, ahead: Array) -> Array:
    """Return the frame between the closed fingertips, (4, 4), world: z ahead, x along the closing direction."""
    one, other = fingers
    pads = [one.pad, other.pad]
    end = min(geom_reach(model, data, g, ahead) for g in pads)
    root = max(-geom_reach(model, data, g, -ahead) for g in pads)
    at = data.geom_xpos[pads].mean(axis=0)
    middle = (geom_reach(model, data, other.pad, closing) - geom_reach(model, data, one.pad, -closing)) / 2.0
    at += (middle - at @ closing) * closing + (max(end - _TIP_M, (end + root) / 2.0) - at @ ahead) * ahead
    return frame(np.column_stack([closing, np.cross(ahead, closing), ahead]), at)


def _couple(spec: Any, first: str, second: str, states: Array) -> tuple[float, float]:
    """Let the second finger follow the first one, in place of a coupling or an actuator that the model has.

    Returns:
        (slope, offset): The position of the second joint is slope times that of the first plus offset, [m].
    """
    for each in [*spec.equalities, *spec.actuators]:
        names = (each.name1, each.name2) if hasattr(each, "name1") else (each.target,)
        if {first, second} & {*names}:
            spec.delete(each)
    along, follows = states[-1] - states[0]
    slope = float(follows / along)
    offset = float(states[0, 1] - slope * states[0, 0])
    coupling = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=second, name2=first)
    coupling.data[:5] = (offset, slope, 0.0, 0.0, 0.0)
    coupling.solref[:] = (0.004, 1.0)
    coupling.solimp[:] = (0.98, 0.999, 0.0001, 0.5, 2.0)
    for name in (first, second):
        spec.joint(name).armature = _ARMATURE_KG
    return slope, offset


def _limit_force(model: Any, joint: int) -> float:
    """Return the largest force of a joint, [N]; infinite if not stated."""
    return float(np.abs(model.jnt_actfrcrange[joint]).max()) if model.jnt_actfrclimited[joint] else np.inf


def _add_drive(spec: Any, shares: dict[str, float], force_n: float) -> None:
    """Add the position actuator of the coupled fingers, critically damped; it pulls at both, so none leads.

    Args:
        shares: Joint -> its coefficient in the tendon that is driven.
        force_n: Largest force of each pad; the actuator has twice as much.
    """
    tendon = spec.add_tendon(name=_DRIVE)
    for joint, share in shares.items():
        tendon.wrap_joint(joint, share)
    drive = spec.add_actuator(name=_DRIVE, target=_DRIVE, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    drive.set_to_position(kp=2.0 * force_n / _SQUEEZE_M, dampratio=1.0)
    drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
    drive.forcerange[:] = (-2.0 * force_n, 2.0 * force_n)
