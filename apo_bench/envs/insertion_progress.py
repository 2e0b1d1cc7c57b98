"""How far the part truly is inside its hole: the basis of rewards and `info`, which no policy may use."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.task.tip_control import TipControl

PHASES = ("approach", "contact", "inside", "arrived", "released")
"""Phases of an operation: before the first contact, after it, in the hole, at its end, after the hand opened."""
_ARRIVED_M = 0.001
"""Distance before the end of the motion up to which a part counts as fully inserted."""
_ASIDE_M = 0.001
"""Lateral error beyond the play of the parts up to which the part can be inside of the hole."""


@final
@dataclass
class InsertionProgress:
    """The depth of the part inside its hole during one operation."""

    hole_m: float
    """Length of the motion inside of the hole, from its entrance to where the actions end; 0 without a hole."""
    left_m: float
    """Distance from where the actions end to the goal; above 0 if the grip changes on the way."""
    aside_m: float
    """Greatest lateral error of a part inside of the hole."""
    depth_m: float = 0.0
    """Present depth in the hole."""
    deepest_m: float = 0.0
    """Greatest depth so far."""
    inserted: bool = False
    """Whether the part was fully inserted at any moment."""

    def update(self, off: Array) -> float:
        """Take the present error of the part, and return by how much the square of the deepest share of the hole grew.

        The square rewards an insertion: random actions enter holes by a tenth of their length.

        Args:
            off: True error of the part relative to its target, (6,), [m, rad]; the third number leads in.
        """
        left = -float(off[2]) - self.left_m
        is_inside = bool(np.hypot(off[0], off[1]) < self.aside_m)
        self.depth_m = float(np.clip(self.hole_m - left, 0.0, self.hole_m)) if is_inside else 0.0
        self.inserted = self.inserted or (is_inside and abs(left) < _ARRIVED_M)
        before = self.deepest_m
        self.deepest_m = max(before, self.depth_m)
        return (self.deepest_m**2 - before**2) / self.hole_m**2 if self.deepest_m > before else 0.0


def begin_progress(control: TipControl, clearance_mm: float) -> InsertionProgress:
    """Return the progress of an operation before its first action."""
    t = control.start.transfer
    hole = max(t.entrances, default=0.0 if t.into.level else t.depth)
    return InsertionProgress(max(hole - control.left, 0.0), control.left, 2e-3 * clearance_mm + _ASIDE_M)


def find_phase(control: TipControl, progress: InsertionProgress) -> str:
    """Return the present one of `PHASES`; whether the part is inside of the hole is the truth."""
    if control.arrived:
        return "arrived"
    if progress.depth_m > _ARRIVED_M:
        return "inside"
    return "approach" if control.in_free_air else "contact"
