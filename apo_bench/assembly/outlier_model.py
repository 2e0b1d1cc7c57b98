"""How often observations are worse than their covariance says, and how much."""

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
    """Part of the operations of which what was seen says nothing."""
    broad: float = 0.03
    """Part that is seen with `times` the stated deviation."""
    times: float = 10.0
    relation: float = 0.001
    """Part of the relations that are wrong."""
    flip: float = 0.25
    """Part of the gross ones of a part that nearly looks the same after some turns that are turned so."""

    def __post_init__(self) -> None:
        rates = (self.gross, self.broad, 1.0 - self.gross - self.broad, self.relation, self.flip)
        require(
            all(0.0 < rate < 1.0 for rate in rates),
            f"rates of {self.gross!r} gross, {self.broad!r} broad, {self.relation!r} wrong relations, "
            f"{self.flip!r} turned were given; all must be above 0, gross and broad together and each other one "
            "below 1.",
        )
        require(
            1.0 < self.times < np.inf,
            f"times={self.times!r} was given; a broad observation needs a finite number above 1.",
        )

    @property
    def surprises(self) -> tuple[float, float, float]:
        """-2 log of the probability of an inlier, a broad and a gross observation, beside that of an inlier."""
        inlier = 1.0 - self.gross - self.broad
        return 0.0, -2.0 * float(np.log(self.broad / inlier)), -2.0 * float(np.log(self.gross / inlier))

    def gross_surprises(self, flips: int) -> tuple[float, float]:
        """The same of a gross observation that is no flip, and of one that is a certain one of so many flips."""
        gross = self.surprises[2]
        if not flips:
            return gross, np.inf
        return gross - 2.0 * float(np.log1p(-self.flip)), gross - 2.0 * float(np.log(self.flip / flips))

    @property
    def relation_surprise(self) -> float:
        """The same of a wrong relation, beside a right one."""
        return -2.0 * float(np.log(self.relation / (1.0 - self.relation)))


def measured_rates(gross: float, broad: float = OutlierModel.broad, times: float = OutlierModel.times) -> OutlierModel:
    """A model with rates that were measured, kept away from 0 and 1, which no number of measurements proves."""
    gross, broad = (float(np.clip(rate, _LEAST_RATE, 0.49)) for rate in (gross, broad))
    return OutlierModel(gross, broad, times)
