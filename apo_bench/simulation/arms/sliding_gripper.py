"""Find the gripper of two sliding fingers in the model of an arm, and drive it."""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.errors import require
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
_PARALLEL = 0.99  # least cosine between the axes of the fingers
_LEAST_M = 1e-6  # from the last body ahead to the fingers
COUPLED_SOLREF = (0.004, 1.0)  # of coupled fingers, as in the grippers that come with the benchmark
COUPLED_SOLIMP = (0.98, 0.999, 0.0001, 0.5, 2.0)  # of the same


class _Fingers(NamedTuple):
    """Two sliding fingers."""

    joints: list[int]
    pads: list[int]
    """The geom of each finger that reaches farthest ahead."""
    closing: Array
    """Direction in which the first finger opens, (3,), world."""
    ahead: Array
    """Direction from the last body to the fingers, (3,), world."""
    ends: Array
    """(2, 2): positions of both joints when closed, and when open, [m]."""


def drive_sliding_gripper(spec: Any, model: Any, last: str, description: ArmDescription) -> tuple[Hand, Array]:
    """Couple the two sliding fingers beyond the last body of an arm, and add a position actuator for both.

    Args:
        model: The compiled model of `spec`, whose fingers are not driven yet.
        last: The last body of the arm.

    Returns:
        The gripper, and its tip in the last body, (4, 4).

    Raises:
        InputError: There are not two sliding fingers that open in opposite directions.
    """
    data = mujoco.MjData(model)
    body = model.body(last).id
    mujoco.mj_kinematics(model, data)
    fingers = _find_fingers(model, data, body, description)
    closed, widest = fingers.ends
    states = np.linspace(closed, widest, _ROWS)
    gaps = [_measure_gap(model, data, fingers, state) for state in states[::-1]][::-1]
    T_tip = pose.inverse(body_frame(data, body)) @ _find_tip(model, data, fingers)  # closed, by the last measurement
    apart = (data.geom_xpos[fingers.pads[0]] - data.geom_xpos[fingers.pads[1]]) @ fingers.closing
    names = [model.joint(j).name for j in fingers.joints]
    limits = [np.abs(model.jnt_actfrcrange[j]).max() / 2.0 for j in fingers.joints if model.jnt_actfrclimited[j]]
    force = float(min([_FORCE_N, *limits]))
    slope, offset = _couple(spec, names, states)
    _add_drive(spec, {names[0]: 0.5, names[1]: 0.5 / slope}, force)
    # The first row commands the closed fingers into the part.
    beyond = states[0, 0] - np.sign(states[-1, 0] - states[0, 0]) * _SQUEEZE_M
    hand = Hand(
        actuators=(_DRIVE,),
        joints=tuple(names),
        opening=np.array([gaps[0] - 1e-3, *gaps]) / 2.0,
        commands=(np.array([beyond, *states[:, 0]]) + 0.5 * offset / slope)[:, None],
        states=np.array([states[0], *states]),
        force_n=force,
        squeeze_m=_SQUEEZE_M,
        friction=float(model.geom_friction[fingers.pads[0], 0]),
        seconds=_SECONDS,
        pads=(model.geom(fingers.pads[0]).name, model.geom(fingers.pads[1]).name),
        thick_m=float(apart) - gaps[0],
    )
    return hand, T_tip


def _find_fingers(model: Any, data: Any, body: int, description: ArmDescription) -> _Fingers:
    """Return the two sliding fingers beyond a body."""
    slide = int(mujoco.mjtJoint.mjJNT_SLIDE)
    hanging = below(model, body)
    slides = [j for j in range(model.njnt) if int(model.jnt_type[j]) == slide and int(model.jnt_bodyid[j]) in hanging]
    geoms = [np.flatnonzero(model.geom_bodyid == model.jnt_bodyid[j]) for j in slides]
    require(
        len(slides) == 2 and all(map(len, geoms)) and bool(model.jnt_limited[slides].all()),
        f"{description.file}: the model has no two sliding fingers with a range and a shape beyond "
        f"'{model.body(body).name}'; name a gripper file as 'hand' in [gripper], or state 'slides'.",
    )
    middles = np.array([data.geom_xpos[g].mean(axis=0) for g in geoms])
    axes = data.xaxis[slides]
    closing = axes[0] * np.sign(axes[0] @ (middles[0] - middles[1]))
    signs = np.sign(axes @ closing) * [1, -1]
    ahead = middles.mean(axis=0) - data.xpos[body]
    ahead = ahead - (ahead @ closing) * closing
    require(
        abs(axes[0] @ axes[1]) > _PARALLEL and np.linalg.norm(ahead) > _LEAST_M,
        f"{description.file}: the fingers do not open in opposite directions across the way ahead; state them as "
        "'slides', 'tip', 'opening_mm' and 'actuators' in [gripper].",
    )
    ahead /= np.linalg.norm(ahead)
    pads = [int(max(own, key=lambda g: geom_reach(model, data, int(g), ahead))) for own in geoms]
    ends = np.array([model.jnt_range[j][:: int(sign)] for j, sign in zip(slides, signs, strict=True)]).T
    return _Fingers(slides, pads, closing, ahead, ends)


def _measure_gap(model: Any, data: Any, fingers: _Fingers, state: Array) -> float:
    """Put the joints to positions, (2,), and return the distance of the pads, [m]; negative if they overlap."""
    data.qpos[model.jnt_qposadr[fingers.joints]] = state
    mujoco.mj_kinematics(model, data)
    return -sum(
        geom_reach(model, data, pad, sign * fingers.closing) for pad, sign in zip(fingers.pads, (-1, 1), strict=True)
    )


def _find_tip(model: Any, data: Any, fingers: _Fingers) -> Array:
    """Return the frame between the fingertips, (4, 4), world: z ahead, x along the closing direction."""
    one, other = fingers.pads
    _, _, closing, ahead, _ = fingers
    end = min(geom_reach(model, data, pad, ahead) for pad in fingers.pads)
    root = max(-geom_reach(model, data, pad, -ahead) for pad in fingers.pads)
    middle = (geom_reach(model, data, other, closing) - geom_reach(model, data, one, -closing)) / 2.0
    at = data.geom_xpos[fingers.pads].mean(axis=0)
    at += (middle - at @ closing) * closing + (max(end - _TIP_M, (end + root) / 2.0) - at @ ahead) * ahead
    return frame(np.column_stack([closing, np.cross(ahead, closing), ahead]), at)


def _couple(spec: Any, joints: list[str], states: Array) -> tuple[float, float]:
    """Let the second finger follow the first one, in place of a coupling or an actuator that the model has.

    Args:
        states: Positions of both joints from closed to open, (n, 2).

    Returns:
        (slope, offset): The position of the second joint is slope times that of the first plus offset, [m].
    """
    for each in [*spec.equalities, *spec.actuators]:
        if {*joints} & {getattr(each, key, "") for key in ("name1", "name2", "target")}:
            spec.delete(each)
    along, follows = states[-1] - states[0]
    slope = float(follows / along)
    offset = float(states[0, 1] - slope * states[0, 0])
    coupling = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=joints[1], name2=joints[0])
    coupling.data[:5] = (offset, slope, 0.0, 0.0, 0.0)
    coupling.solref[:] = COUPLED_SOLREF
    coupling.solimp[:] = COUPLED_SOLIMP
    for name in joints:
        spec.joint(name).armature = _ARMATURE_KG
    return slope, offset


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
