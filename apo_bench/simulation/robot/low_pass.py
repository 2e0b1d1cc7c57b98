"""Forces as a sensor gives them: averaged over the last milliseconds."""

from __future__ import annotations

from collections.abc import Sequence

WRIST_S = 0.02
"""Time constant of the sensor at the wrist (8 Hz). Where hard parts touch, the force of a single step nearly doubles
when the step is halved, while its impulse stays; behind the filter it hardly depends on the step. Real sensors of force
are read behind filters of 5 to 70 Hz for the same reason."""


class LowPass:
    """A first-order filter, y' = (x - y) / time constant. Plain numbers, since arrays this small are slow."""

    def __init__(self, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self.force = [0.0, 0.0, 0.0]

    def __call__(self, force: Sequence[float], seconds: float) -> list[float]:
        """The filtered force, (3,), [N], after one that was felt for so long; at most the time constant."""
        part = seconds / self._time_constant_s
        x, y, z = self.force
        fx, fy, fz = force
        self.force = [x + (fx - x) * part, y + (fy - y) * part, z + (fz - z) * part]
        return self.force
