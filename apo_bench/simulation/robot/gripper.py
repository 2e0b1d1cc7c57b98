"""The gripper of a scene: its shape as boxes, and how its fingers are measured and commanded.

An opening is always that of each finger, half the distance between the pads, [m].
"""

import math
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from apo_bench.geometry import Array, Box
from apo_bench.simulation.arms.arm import Arm, Hand
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.arms.shapes import below
from apo_bench.simulation.frames import frame

_UPRIGHT_M = 0.001
"""Largest margin along the tip's axis; small, since the height of supports is known well."""
STUCK_M = 0.002
"""Opening fingers farther than this from their command have not arrived: they stick to a part, or start late."""
_LONGEST_S = 0.2
"""Time that fingers of a stiff drive may take to rest after their command has arrived."""


def open_hand(kinematics: Kinematics, opening: float) -> tuple[Any, Array]:
    """Return the `MjData` of the arm alone with its fingers at an opening, and the pose of the tip in it, (4, 4)."""
    arm = kinematics.arm
    model = kinematics.model
    data = mujoco.MjData(model)
    for finger, joint in zip(arm.fingers, arm.finger_joints(opening), strict=True):
        data.qpos[model.jnt_qposadr[model.joint(finger).id]] = joint
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    tip = model.site(arm.tip).id
    return data, frame(data.site_xmat[tip], data.site_xpos[tip])


@lru_cache(maxsize=64)
def list_gripper_boxes(kinematics: Kinematics, opening: float, margin: float = 0.0) -> tuple[Box, ...]:
    """Return the bounding boxes, along the axes of the tip, of all geoms of the gripper that can touch something.

    Args:
        margin: Added on both sides of each box across the axis of the tip, [m]; along it `_UPRIGHT_M` at most.
    """
    model = kinematics.model
    data, T_tip = open_hand(kinematics, opening)
    R = T_tip[:3, :3]
    hanging = below(model, model.body(kinematics.arm.mount).id)
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    boxes = []
    for g in range(model.ngeom):
        if touching[g] and int(model.geom_bodyid[g]) in hanging:
            # The half sizes of the box around a turned box are |R| times its own.
            R_tip_geom = R.T @ data.geom_xmat[g].reshape(3, 3)
            at = R.T @ (data.geom_xpos[g] - T_tip[:3, 3]) + R_tip_geom @ model.geom_aabb[g, :3]
            half = np.abs(R_tip_geom) @ model.geom_aabb[g, 3:] + [margin, margin, min(margin, _UPRIGHT_M)]
            boxes.append(Box(f"gripper{g}", at, half))
    return tuple(boxes)


class SlideFingers:
    """Fingers on slide joints that are zero when closed, with one position actuator for all."""

    def __init__(self, model: Any, arm: Arm) -> None:
        self._grip = model.actuator(f"arm/{arm.grip}").id
        limit = model.actuator_forcerange[self._grip, 1]
        stiffness = model.actuator_gainprm[self._grip, 0]
        self.slack = float(limit / stiffness) if model.actuator_forcelimited[self._grip] else math.inf
        """Distance between command and opening at which the drive reaches its force limit, [m]."""
        self.longest_s = _LONGEST_S
        """Time that the fingers may take to rest after their command has arrived, [s]."""
        joints = [model.joint(f"arm/{name}").id for name in arm.fingers]
        self._dof = model.jnt_dofadr[joints]
        self._qpos = model.jnt_qposadr[joints]

    def opening(self, data: Any) -> float:
        """Return the measured opening: that of the finger that is less open."""
        return float(data.qpos[self._qpos].min())

    def speed(self, data: Any) -> float:
        """Return the speed of the faster finger, [m/s]."""
        return float(np.abs(data.qvel[self._dof]).max())

    def command(self, data: Any, opening: float) -> None:
        """Command an opening; fingers that cannot reach it push with their force."""
        data.ctrl[self._grip] = opening

    def commanded(self, data: Any) -> float:
        """Return the commanded opening."""
        return float(data.ctrl[self._grip])

    def put(self, data: Any, opening: float) -> None:
        """Set opening and command at once, without simulation."""
        data.qpos[self._qpos] = opening
        self.command(data, opening)


class MeasuredFingers:
    """Fingers of any mechanism, by the measured relation of opening, joints and commands; methods as `SlideFingers`."""

    def __init__(self, model: Any, hand: Hand, tip: str) -> None:
        self.hand = hand
        self.slack = math.inf
        self.longest_s = max(hand.seconds, _LONGEST_S)
        self._actuators = np.array([model.actuator(f"arm/{name}").id for name in hand.actuators])
        self._pads = np.array([model.geom(f"arm/{name}").id for name in hand.pads])
        self._tip = model.site(f"arm/{tip}").id
        joints = [model.joint(f"arm/{name}").id for name in hand.joints]
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        # How far the pads come apart per radian or metre of each joint, over its whole range.
        ranges = np.ptp(hand.states, axis=0)
        lever = np.abs(hand.opening[-1] - hand.opening[0]) / np.maximum(ranges, 1e-9)
        self._lever: Array = np.where(ranges > 1e-6, lever, 0.0)

    def opening(self, data: Any) -> float:
        left, right = data.geom_xpos[self._pads]
        # Elements 0, 3 and 6 of the tip's rotation matrix are its x axis, along which the fingers close.
        return (abs(float((left - right) @ data.site_xmat[self._tip][::3])) - self.hand.thick_m) / 2

    def speed(self, data: Any) -> float:
        return float(np.abs(data.qvel[self._dof] * self._lever).max())

    def command(self, data: Any, opening: float) -> None:
        data.ctrl[self._actuators] = self.hand.command(opening)

    def commanded(self, data: Any) -> float:
        return self.hand.of_command(data.ctrl[self._actuators])

    def put(self, data: Any, opening: float) -> None:
        data.qpos[self._qpos] = self.hand.state(opening)
        data.qvel[self._dof] = 0.0
        self.command(data, opening)


def fingers_of(model: Any, arm: Arm) -> SlideFingers | MeasuredFingers:
    """Return the fingers of an arm: by measurement if the arm has a `hand` description, else slide joints."""
    return SlideFingers(model, arm) if arm.hand is None else MeasuredFingers(model, arm.hand, arm.tip)
