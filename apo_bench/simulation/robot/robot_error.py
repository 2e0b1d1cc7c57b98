"""The errors of one robot during one trial: drawn before it, and known only to the physics.

Planners, predictors and correctors know the nominal robot. Guards still act on the measured forces.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.geometry import Array


@final
@dataclass(frozen=True, eq=False)
class RobotError:
    """The errors of one trial."""

    hand_eye: Array
    """(4, 4): where the robot goes, in the world, for a pose in the world."""
    joints: Array
    """(joints,): by how much every joint is off what its encoder says, [rad]."""
    tool: Array
    """(4, 4): where the tip comes to be, in the frame of where the robot estimates it."""
    in_hand: Array
    """(n, 4, 4): how the part of each operation slips when it was taken, in the frame of the tip."""

    def plan(self, plan: Plan) -> Plan:
        """The plan as the robot takes it: everything where a wrong base puts it."""
        E = self.hand_eye
        if np.array_equal(E, np.eye(4)):
            return plan
        start = {part: E @ T for part, T in plan.start.items()}
        return replace(plan, start=start, target_poses=E @ plan.target_poses, step_poses=E @ plan.step_poses)

    def slips(self, operation: int) -> bool:
        """Whether the part of an operation moves in the hand."""
        return not np.array_equal(self.in_hand[operation], np.eye(4))
