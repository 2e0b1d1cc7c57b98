"""Thresholds of gap and angle within which the stated noise explains that faces do not touch."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import FacingPair
from apo_bench.errors import require
from apo_bench.geometry import Array

CONTACT_SOFT_M = 0.1e-3
_SOFT_RAD = math.radians(0.1)
"""Standard deviation of a contact that is there: parts sink in a little, and the filter is linear."""


@final
@dataclass(frozen=True)
class Rules:
    """What counts as a contact."""

    miss: float = 1e-4
    """How often the noise may hide one face contact: 20, tested three ways, are then all found 99.4 % of the time."""
    gap_m: float = 10e-3
    """No gap beyond this counts as noise."""
    angle_rad: float = math.radians(20.0)
    """The largest angle between a normal and the opposite of the other."""
    share: float = 0.15
    """The overlap is at least this part of the smaller face."""

    def __post_init__(self) -> None:
        for name, high in (("miss", 1.0), ("gap_m", 1.0), ("angle_rad", math.pi / 2), ("share", 1.0)):
            value = getattr(self, name)
            require(
                isinstance(value, int | float) and 0.0 < value < high,
                f"{name}={value!r} was given as a rule of recognition; above 0 and below {high:g} is allowed.",
            )

    def most_of(self, count: int) -> float:
        """Largest squared Mahalanobis length of so many residuals that the noise explains: a chi-square quantile."""
        return _quantile(self.miss, count)


RULES_BY_NOISE = Rules()
"""Thresholds from the stated noise."""


class PairThresholds(NamedTuple):
    """The thresholds of one pair of faces."""

    gap_m: float
    angle_rad: float


def pair_thresholds(rules: Rules, covariance: Array, slack: PairThresholds, lengths: int = 1) -> PairThresholds:
    """The largest gap and angle that noise and play explain, within the bounds.

    The gap is Gaussian and may lie on either side; the angle is the length of two Gaussian tilts, at most as long as
    if both were as uncertain as the worse direction. Of round faces the gap may be such a length, too.

    Args:
        covariance: (3, 3), of gap and tilts, from the noise of all poses, [m, rad]; (r, r) of round faces.
        slack: What play allows in addition.
        lengths: How many rows are lengths, before those of tilts; without any of these the angle is free.
    """
    gap = _longest(rules.miss, covariance[:lengths, :lengths], CONTACT_SOFT_M)
    angle = _longest(rules.miss, covariance[lengths:, lengths:], _SOFT_RAD)
    return PairThresholds(min(gap + slack.gap_m, rules.gap_m), min(angle + slack.angle_rad, rules.angle_rad))


def _longest(miss: float, covariance: Array, soft: float) -> float:
    """The length of Gaussian numbers, (r, r), that is exceeded so rarely, each as uncertain as the worst direction."""
    if len(covariance) == 0:
        return math.inf
    if len(covariance) == 1:
        return _two_sided(miss) * math.sqrt(covariance[0, 0] + soft**2)
    # The length of r Gaussian numbers of one variance is that times chi with r degrees of freedom; of two, Rayleigh's
    # distribution, whose quantile has a closed form.
    worst = max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)
    if len(covariance) == 2:
        return math.sqrt(-2.0 * math.log(miss) * (worst + soft**2))
    return math.sqrt(_quantile(miss, len(covariance)) * (worst + soft**2))


def slack(pair: FacingPair, play_m: float) -> PairThresholds:
    """How far off a contact with this play can be: from side to side, and tilted from corner to corner."""
    return PairThresholds(play_m, 2.0 * play_m * math.hypot(*(0.5 / max(half, play_m, 1e-9) for half in pair.half_m)))


def reality(pair: FacingPair, play_m: float) -> Array:
    """(3, 3), covariance of gap and tilts of a contact that is there: uniform within its play, and a little soft.

    (r, r) of round faces.
    """
    # Uniform within +-p has the variance p^2 / 3; a face of half length h may tilt by p / h.
    tilts = [play_m / max(half, play_m, 1e-9) for half in pair.half_m]
    plays = [play_m] * pair.lengths + tilts
    soft = [CONTACT_SOFT_M] * pair.lengths + [_SOFT_RAD] * len(tilts)
    return np.diag([x * x / 3.0 + y * y for x, y in zip(plays, soft, strict=True)])


@lru_cache
def _quantile(miss: float, count: int) -> float:
    from scipy.stats import chi2

    return float(chi2.isf(miss, count))


@lru_cache
def _two_sided(miss: float) -> float:
    from scipy.stats import norm

    return float(norm.isf(miss / 2))
