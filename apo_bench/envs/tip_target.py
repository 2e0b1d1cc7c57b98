"""What an action of `APOInsert-v0` means: a target of the tip about the line into the estimated hole."""

import math
from typing import final

import numpy as np

from apo_bench.envs.insert_spaces import Action
from apo_bench.geometry import Array


@final
class TipTarget:
    """The displacement of the tip by the actions of an episode, in the insertion frame."""

    def __init__(self, step: Array, reach: Array) -> None:
        """Begin without a displacement.

        Args:
            step: Greatest displacement in an action, (6,), [m, rad].
            reach: Displacement by an action of 1, (6,), [m, rad]; the third number has no effect.
        """
        self.step = step
        self.reach = reach
        self.at: Array = np.zeros(6)
        """The displacement so far, (6,), [m, rad]."""

    def restart(self) -> None:
        """Begin again without a displacement."""
        self.at = np.zeros(6)

    def move(self, action: Action) -> tuple[Array, Array]:
        """Move towards the target of an action; return the shift, (3,), [m], and the turn, (3,), [rad]."""
        numbers = action[:6].astype(np.float64)
        moved = np.clip(self.reach * numbers - self.at, -self.step, self.step)
        moved[2] = numbers[2] * self.step[2]  # along the axis an action is a step
        self.at = self.at + moved
        return moved[:3], moved[3:]


def to_twist(mm: float, deg: float) -> Array:
    """Return the same translation, [mm], and rotation, [deg], about each axis, (6,), [m, rad]."""
    return np.repeat([1e-3 * mm, math.radians(deg)], 3)
