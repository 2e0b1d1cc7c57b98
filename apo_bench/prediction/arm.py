"""What an arm makes of a plan, as plain numbers: whoever knows the arm works them out, the prediction weighs them."""

from dataclasses import dataclass, field
from typing import Literal, final

import numpy as np

from apo_bench.geometry import Array

Refused = Literal["unreachable_start", "unreachable"]


@final
@dataclass(frozen=True, eq=False)
class ArmMove:
    """One operation of a plan that is done, or undone, by an arm."""

    operation: int
    """Counted from 0."""
    undo: bool = False
    refused: Refused | None = None
    """Why it is not begun: there are no joint angles where the part is taken, or where it is put."""
    at_limit: str = ""
    """The joint that stands at its limit there; empty where the arm is too short, or nothing is refused."""
    struck: str = ""
    """The part that the open gripper is deepest in, where it takes hold or lets go."""
    struck_mm: float = 0.0
    sag: Array = field(default_factory=lambda: np.eye(4))
    """Where the weight of what is held takes it, a displacement of the world, (4, 4), [m]."""
    beside_mm: float = 0.0
    """How far the tip goes beside its line, moving, at most."""
    margin_deg: float | None = None
    """The least distance of a joint from its limits where the tip turns or stops; None where nothing is known of it."""
