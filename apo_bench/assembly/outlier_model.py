"""Rates and sizes of outliers, for correctors that allow for observations worse than the stated noise."""

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.errors import require

_LEAST_RATE = 1e-3
"""Least rate of a measured model: a rate measured as 0 may still be as large as this."""


@final
@dataclass(frozen=True)
class OutlierModel:
    """Rates and sizes of outliers, stated by the noise model if it knows them, otherwise assumed."""

    gross: float = 0.1
    """Fraction of operations whose observation says nothing of the pose."""
    broad: float = 0.03
    """Fraction of operations observed with `times` the stated standard deviation."""
    times: float = 10.0
    """Ratio of the standard deviation of broad observations to the stated one."""
    relation: float = 0.001
    """Fraction of relations that are wrong."""
    flip: float = 0.25
    """Share of the gross observations that are turned by an approximate symmetry, of parts that have one."""
    stale: float = 0.15
    """Share of the gross observations that are where the part was before."""
    swap: float = 0.1
    """Share of the gross observations that are exchanged with those of another part."""
    shift: float = 0.2
    """Share of the gross observations that have the right rotation but are too near or too far. The remaining share is
    anywhere."""
    view: float = 0.02
    """Probability that several consecutive operations are displaced together."""
    repeat: float = 0.2
    """Probability that a later observation repeats the error of a false one."""
    camera_m: tuple[float, float, float] | None = None
    """Position of the camera, world frame, [m]: distance errors are along its ray. None: in any direction."""

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
        """-2 log of the probability of an inlier, a broad and a gross observation, in this order, relative to an
        inlier.
        """
        inlier = 1.0 - self.gross - self.broad
        return 0.0, -2.0 * float(np.log(self.broad / inlier)), -2.0 * float(np.log(self.gross / inlier))

    @property
    def relation_surprise(self) -> float:
        """-2 log of the probability of a wrong relation, relative to a right one."""
        return -2.0 * float(np.log(self.relation / (1.0 - self.relation)))


def make_measured_model(
    gross: float, broad: float = OutlierModel.broad, times: float = OutlierModel.times
) -> OutlierModel:
    """A model with measured rates, limited to the range from 0.001 to 0.49, since no measurement proves 0 or 1."""
    gross, broad = (float(np.clip(rate, _LEAST_RATE, 0.49)) for rate in (gross, broad))
    return OutlierModel(gross, broad, times)
