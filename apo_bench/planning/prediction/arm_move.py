"""What an operation of a plan asks of an arm, as plain numbers that the simulation computes."""

from dataclasses import dataclass, field
from typing import Literal, final

import numpy as np

from apo_bench.geometry import Array

Refused = Literal["unreachable_start", "unreachable"]


@final
@dataclass(frozen=True, eq=False)
class ArmMove:
    """The motion of an arm in one operation, or in undoing it, as plain numbers."""

    operation: int
    """Counted from 0."""
    undo: bool = False
    refused: Refused | None = None
    """Why the plan is not started: no joint angles reach the pick pose, or the goal and its approach."""
    at_limit: str = ""
    """The joint at its limit in a refused pose; empty if the arm is too short, or nothing is refused."""
    collides_with: str = ""
    """The part that the open gripper penetrates the deepest at grasp or release."""
    collision_mm: float = 0.0
    """That depth."""
    sag: Array = field(default_factory=lambda: np.eye(4))
    """Displacement of the held part by its weight, (4, 4), world frame, [m]."""
    beside_mm: float = 0.0
    """Largest deviation of the moving tip from its line."""
    margin_deg: float | None = None
    """Least distance of a joint from its limits at the key poses; None if unknown."""
