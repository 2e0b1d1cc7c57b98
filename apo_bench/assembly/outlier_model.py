"""How often observations are worse than their noise model says, and in which way."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.errors import require

_LEAST_RATE = 1e-3
"""A rate that is measured as 0 is not known to be smaller."""


@final
@dataclass(frozen=True)
class OutlierModel:
    """Rates and breadths: stated by noise that knows them, assumed otherwise."""

    gross: float = 0.1
    """Part of the operations of which what was observed says nothing."""
    broad: float = 0.03
    """Part that is observed with `times` the stated deviation."""
    times: float = 10.0
    relation: float = 0.001
    """Part of the relations that are wrong."""
    flip: float = 0.25
    """Part of the gross ones of a part that nearly looks the same after some turns that are turned so."""
    stale: float = 0.15
    """Part of the gross ones that are where the part was before."""
    swap: float = 0.1
    """Part of the gross ones that are where another part is, which is observed here in turn."""
    shift: float = 0.2
    """Part of the gross ones that are turned rightly and too near or too far; what is left over has no name."""
    view: float = 0.02
    """How often several operations, one after the other, are displaced together."""
    repeat: float = 0.2
    """How often a later look repeats what was false in the first."""
    camera_m: tuple[float, float, float] | None = None
    """Where the camera stands, world frame, [m]: what is too near or far is so on its ray. None: in any direction."""

    def __post_init__(self) -> None:
        named = self.flip + self.stale + self.swap + self.shift
        for name in ("gross", "broad", "relation", "flip", "stale", "swap", "shift", "view"):
            rate = getattr(self, name)
            require(0.0 < rate < 1.0, f"{name}={rate!r} was given; give a rate above 0 and below 1.")
        require(self.gross + self.broad < 1.0, "gross and broad add up to 1 or more; give rates whose sum is below 1.")
        require(named < 1.0, f"flip, stale, swap and shift add up to {named:g}; give shares whose sum is below 1.")
        require(0.0 <= self.repeat < 1.0, f"repeat={self.repeat!r} was given; give a rate of 0 or more and below 1.")
        require(1.0 < self.times < np.inf, f"times={self.times!r} was given; give a finite number above 1.")

    @property
    def surprises(self) -> tuple[float, float, float]:
        """-2 log of the probability of an inlier, a broad and a gross observation, relative to that of an inlier."""
        inlier = 1.0 - self.gross - self.broad
        return 0.0, -2.0 * float(np.log(self.broad / inlier)), -2.0 * float(np.log(self.gross / inlier))

    @property
    def relation_surprise(self) -> float:
        """The same of a wrong relation, relative to a right one."""
        return -2.0 * float(np.log(self.relation / (1.0 - self.relation)))


def make_measured_model(
    gross: float, broad: float = OutlierModel.broad, times: float = OutlierModel.times
) -> OutlierModel:
    """A model with rates that were measured, kept away from 0 and 1, which no number of measurements proves."""
    gross, broad = (float(np.clip(rate, _LEAST_RATE, 0.49)) for rate in (gross, broad))
    return OutlierModel(gross, broad, times)
