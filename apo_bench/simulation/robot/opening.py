"""The fingers of a compiled scene: what they are commanded to, and how far open they are."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.hand import Hand

_LONGEST_S = 0.2
"""How long fingers of a stiff drive may take to rest behind their command."""


class Fingers(Protocol):
    """Openings are of each finger, [m]."""

    slack: float
    """So far from where it stands a command pushes with all force, [m]."""
    longest_s: float
    """How long the fingers may take to rest behind their command."""

    def opening(self, data: Any) -> float:
        """What the fingers measure."""

    def speed(self, data: Any) -> float:
        """How fast the fastest finger moves, [m/s]."""

    def command(self, data: Any, opening: float) -> None:
        """Have them go there, or push with what force they have."""

    def commanded(self, data: Any) -> float:
        """Where they shall be."""

    def put(self, data: Any, opening: float) -> None:
        """Bring them there at once, with their command."""


def fingers_of(model: Any, arm: Arm) -> Fingers:
    """The fingers of an arm in a scene."""
    return SlideFingers(model, arm) if arm.hand is None else MeasuredFingers(model, arm.hand, arm.tip)


class SlideFingers:
    """Slide joints that are zero when closed, and one position actuator."""

    def __init__(self, model: Any, arm: Arm) -> None:
        self.longest_s = _LONGEST_S
        self._grip = model.actuator(f"arm/{arm.grip}").id
        limit = model.actuator_forcerange[self._grip, 1]
        stiffness = model.actuator_gainprm[self._grip, 0]
        self.slack = float(limit / stiffness) if model.actuator_forcelimited[self._grip] else math.inf
        self._dof = np.array([model.jnt_dofadr[model.joint(f"arm/{name}").id] for name in arm.fingers])
        self._qpos = np.array([model.jnt_qposadr[model.joint(f"arm/{name}").id] for name in arm.fingers])

    def opening(self, data: Any) -> float:
        return float(data.qpos[self._qpos].min())

    def speed(self, data: Any) -> float:
        return float(np.abs(data.qvel[self._dof]).max())

    def command(self, data: Any, opening: float) -> None:
        data.ctrl[self._grip] = opening

    def commanded(self, data: Any) -> float:
        return float(data.ctrl[self._grip])

    def put(self, data: Any, opening: float) -> None:
        data.qpos[self._qpos] = opening
        data.ctrl[self._grip] = opening


class MeasuredFingers:
    """Any fingers, by what was measured of them."""

    def __init__(self, model: Any, hand: Hand, tip: str) -> None:
        self.hand = hand
        self.slack = math.inf
        self.longest_s = max(hand.seconds, _LONGEST_S)
        self._actuators = np.array([model.actuator(f"arm/{name}").id for name in hand.actuators])
        joints = [model.joint(f"arm/{name}").id for name in hand.joints]
        self._pads = np.array([model.geom(f"arm/{name}").id for name in hand.pads])
        self._tip = model.site(f"arm/{tip}").id
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        self._lever: Array = np.abs(hand.opening[-1] - hand.opening[0]) / np.maximum(np.ptp(hand.states, axis=0), 1e-9)
        self._lever = np.where(np.ptp(hand.states, axis=0) > 1e-6, self._lever, 0.0)

    def opening(self, data: Any) -> float:
        left, right = data.geom_xpos[self._pads]
        across = data.site_xmat[self._tip][::3]
        return (abs(float((left - right) @ across)) - self.hand.thick_m) / 2

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
