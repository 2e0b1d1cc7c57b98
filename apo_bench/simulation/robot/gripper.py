"""The gripper of a scene: the room that it takes, its fingers and their commands.

Openings are of each finger, [m].
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
"""Room above and below: supports are where they are known to be."""
STUCK_M = 0.002
"""Fingers that open do not rest while they are so far from their command: they stick to a part, or start late."""
_LONGEST_S = 0.2
"""How long fingers of a stiff drive may take to rest behind their command."""


def open_hand(kinematics: Kinematics, opening: float) -> tuple[Any, Array]:
    """The arm alone with its hand at an opening, as `MjData`, and the tip there, (4, 4)."""
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
    """The geoms of the gripper that can touch something, in the frame of the tip, each as the box around it.

    Args:
        margin: Added on every level side, [m]; above and below, `_UPRIGHT_M` is.
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
    """Slide joints that are zero when closed, and one position actuator."""

    def __init__(self, model: Any, arm: Arm) -> None:
        self._grip = model.actuator(f"arm/{arm.grip}").id
        limit = model.actuator_forcerange[self._grip, 1]
        stiffness = model.actuator_gainprm[self._grip, 0]
        self.slack = float(limit / stiffness) if model.actuator_forcelimited[self._grip] else math.inf
        """So far from where it stands a command pushes with all force, [m]."""
        self.longest_s = _LONGEST_S
        """How long the fingers may take to rest behind their command."""
        joints = [model.joint(f"arm/{name}").id for name in arm.fingers]
        self._dof = model.jnt_dofadr[joints]
        self._qpos = model.jnt_qposadr[joints]

    def opening(self, data: Any) -> float:
        """What the fingers measure."""
        return float(data.qpos[self._qpos].min())

    def speed(self, data: Any) -> float:
        """How fast the fastest finger moves, [m/s]."""
        return float(np.abs(data.qvel[self._dof]).max())

    def command(self, data: Any, opening: float) -> None:
        """Have them go there, or push with what force they have."""
        data.ctrl[self._grip] = opening

    def commanded(self, data: Any) -> float:
        """The opening that they are commanded to."""
        return float(data.ctrl[self._grip])

    def put(self, data: Any, opening: float) -> None:
        """Bring them there at once, with their command."""
        data.qpos[self._qpos] = opening
        self.command(data, opening)


class MeasuredFingers:
    """Any fingers, by what was measured of them; methods as in `SlideFingers`."""

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
    """The fingers of an arm in a scene."""
    return SlideFingers(model, arm) if arm.hand is None else MeasuredFingers(model, arm.hand, arm.tip)
