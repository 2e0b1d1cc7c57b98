"""The calibration errors of a robot and the slip in its hand during one trial, known only to the physics.

They are drawn before the trial. Planners, predictors and correctors know the nominal robot; guards act on measured
forces.
"""

from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.geometry import Array


@final
@dataclass(frozen=True, eq=False)
class RobotError:
    """The calibration errors of the robot and the slip in its hand in one trial."""

    hand_eye: Array
    """Hand-eye error E, (4, 4): the robot goes to E T for a pose T in the world."""
    joints: Array
    """True joint angle minus encoder reading, (joints,), [rad]."""
    tool: Array
    """Tool error, (4, 4): pose of the real tip in the frame of the estimated tip."""
    in_hand: Array
    """Slip of the part of each of n operations after it was grasped, (n, 4, 4), in the frame of the tip."""
    sag: Array = field(default_factory=lambda: np.zeros(1))
    """Compliance of each joint to the weight of the arm, (joints,) or (1,) if none has any, [rad/(N m)]. The encoders
    sit before it, so they do not show how far the joints yield."""
    finger: float | Array = 0.0
    """Length by which one finger is shorter than the other in the closing direction, along x of the tip, [m]."""
    ft_drift: Array = field(default_factory=lambda: np.zeros(6))
    """Drift of the force-torque sensor, (6,), in its own frame, [N/s, Nm/s]."""

    @property
    def pads(self) -> Array:
        """The pose of the real middle between the pads in the frame of the estimated tip, (4, 4)."""
        pads = np.array(self.tool)
        pads[..., :3, 3] += 0.5 * np.asarray(self.finger)[..., None] * self.tool[..., :3, 0]
        return pads

    def plan(self, plan: Plan) -> Plan:
        """Return the plan with all poses shifted by the hand-eye error, as the robot executes it."""
        E = self.hand_eye
        if np.array_equal(E, np.eye(4)):
            return plan
        start = {part: E @ T for part, T in plan.start.items()}
        return replace(plan, start=start, target_poses=E @ plan.target_poses, step_poses=E @ plan.step_poses)

    def slips(self, operation: int) -> bool:
        """Whether the part of an operation slips in the hand."""
        return not np.array_equal(self.in_hand[operation], np.eye(4))
