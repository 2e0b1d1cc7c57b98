"""Record how a part moves in the hand between grasp and release."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import SlipInHand
from apo_bench.geometry import Array, pose


class GraspSlipMonitor(NamedTuple):
    """Slip in the hand during the present transfer, and that of the finished ones; methods return a new monitor.

    Their argument T is always the pose of the held part in the frame of the tip, (4, 4).
    """

    grasped: Array | None = None
    """The part in the frame of the tip when the fingers had closed, (4, 4); None while nothing is held."""
    carried: tuple[float, float] = (0.0, 0.0)
    """Slip from the grasp to where the last motion begins, [m] and [rad]."""
    moved: tuple[float, float] | None = None
    """Slip from a grasp to its release, the largest if the grip changed, [m] and [rad]; None before a release."""
    finished: tuple[SlipInHand, ...] = ()
    """One record for each finished operation."""

    def grasp(self, T: Array) -> "GraspSlipMonitor":
        """Note that the fingers have closed, also after a change of grip."""
        return self._replace(grasped=T)

    def carry(self, T: Array) -> "GraspSlipMonitor":
        """Note that the part has been carried to where its last motion begins."""
        return self._replace(carried=self._since(T))

    def release(self, T: Array) -> "GraspSlipMonitor":
        """Note that the fingers are about to open, or that the execution ends."""
        here = self._since(T)
        before = self.moved or (0.0, 0.0)
        return self._replace(grasped=None, moved=(max(before[0], here[0]), max(before[1], here[1])))

    def finish(self, operation: int) -> "GraspSlipMonitor":
        """Add the record of the finished transfer of an operation, if a part was held at all."""
        if self.moved is None:
            return GraspSlipMonitor(finished=self.finished)
        return GraspSlipMonitor(finished=(*self.finished, SlipInHand(operation, *self.carried, *self.moved)))

    def _since(self, T: Array) -> tuple[float, float]:
        """Return the slip since the grasp: how far the part moved at the tip, [m], and how far it turned, [rad]."""
        if self.grasped is None:
            return 0.0, 0.0
        moved = T @ pose.inverse(self.grasped)
        return float(np.linalg.norm(moved[:3, 3])), float(np.linalg.norm(pose.log(moved)[3:]))
