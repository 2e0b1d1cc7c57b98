"""Record how a part moves in the hand between grasp and release."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import SlipInHand
from apo_bench.geometry import Array, pose


class GraspSlipMonitor(NamedTuple):
    """What was seen so far of one transfer, and of those before it; each look makes a new one."""

    grasped: Array | None = None
    """The part in the frame of the tip when the fingers had closed, (4, 4); None while nothing is held."""
    carried: tuple[float, float] = (0.0, 0.0)
    moved: tuple[float, float] | None = None
    """By how much since then, [m] and [rad]; None of what was never held."""
    finished: tuple[SlipInHand, ...] = ()

    def grasp(self, T: Array) -> "GraspSlipMonitor":
        """The fingers have closed; once more where the grip is changed."""
        return self._replace(grasped=T)

    def carry(self, T: Array) -> "GraspSlipMonitor":
        """The part is where its last motion begins."""
        return self._replace(carried=self._since(T))

    def release(self, T: Array) -> "GraspSlipMonitor":
        """The fingers are about to open, or nothing goes on."""
        here = self._since(T)
        before = self.moved or (0.0, 0.0)
        return self._replace(grasped=None, moved=(max(before[0], here[0]), max(before[1], here[1])))

    def finish(self, operation: int) -> "GraspSlipMonitor":
        """The transfer is over."""
        if self.moved is None:
            return GraspSlipMonitor(finished=self.finished)
        return GraspSlipMonitor(finished=(*self.finished, SlipInHand(operation, *self.carried, *self.moved)))

    def _since(self, T: Array) -> tuple[float, float]:
        """How far the point between the pads has moved along with the part, and how far the part has turned."""
        if self.grasped is None:
            return 0.0, 0.0
        moved = T @ pose.inverse(self.grasped)
        return float(np.linalg.norm(moved[:3, 3])), float(np.linalg.norm(pose.log(moved)[3:]))
