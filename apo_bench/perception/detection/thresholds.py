"""Thresholds of gap and angle: how far off two touching faces may appear, given the stated noise."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import FacingPair
from apo_bench.errors import require
from apo_bench.geometry import Array

CONTACT_SOFT_M = 0.1e-3
"""Standard deviation of the gap of a true contact: parts sink in a little, and the filter is linear."""
_SOFT_RAD = math.radians(0.1)
"""Standard deviation of a tilt of a true contact, for the same reasons."""


@final
@dataclass(frozen=True)
class Rules:
    """The bounds within which a pair of faces counts as a contact."""

    miss_rate: float = 1e-4
    """Probability that the noise hides one true contact; 20 contacts, three tests each, are all found in 99.4 %."""
    gap_m: float = 10e-3
    """No gap beyond this counts as noise."""
    angle_rad: float = math.radians(20.0)
    """The largest angle between one normal and the opposite of the other."""
    share: float = 0.15
    """Least overlap as a fraction of the smaller face."""

    def __post_init__(self) -> None:
        for name, high in (("miss_rate", 1.0), ("gap_m", 1.0), ("angle_rad", math.pi / 2), ("share", 1.0)):
            value = getattr(self, name)
            require(
                isinstance(value, int | float) and 0.0 < value < high,
                f"{name}={value!r} was given as a rule of recognition; above 0 and below {high:g} is allowed.",
            )

    def largest_explained(self, count: int) -> float:
        """Largest squared Mahalanobis length of `count` residuals that the noise explains: a chi-square quantile."""
        return _chi_square_quantile(self.miss_rate, count)


RULES_BY_NOISE = Rules()
"""The default rules: thresholds follow from the stated noise, within these bounds."""


class PairThresholds(NamedTuple):
    """Largest gap and angle of one pair of faces."""

    gap_m: float
    angle_rad: float


def compute_pair_thresholds(rules: Rules, covariance: Array, slack: PairThresholds, lengths: int = 1) -> PairThresholds:
    """The largest gap and angle that noise and play explain, within the bounds.

    The gap is Gaussian and two-sided. The angle is the length of two Gaussian tilts, both taken as uncertain as the
    less certain direction. For round faces the gap may also be such a length.

    Args:
        covariance: (r, r), of gap and tilts, from the noise of all poses, [m, rad]; r is 3 for flat faces.
        slack: Gap and angle that play allows in addition.
        lengths: How many rows are lengths; the tilts follow. Without tilts only `rules` limits the angle.
    """
    gap = _length_quantile(rules.miss_rate, covariance[:lengths, :lengths], CONTACT_SOFT_M)
    angle = _length_quantile(rules.miss_rate, covariance[lengths:, lengths:], _SOFT_RAD)
    return PairThresholds(min(gap + slack.gap_m, rules.gap_m), min(angle + slack.angle_rad, rules.angle_rad))


def _length_quantile(miss: float, covariance: Array, soft: float) -> float:
    """The length of a Gaussian vector that is exceeded with probability `miss_rate`; infinite if it has no component.

    Args:
        covariance: (r, r); all directions are taken as uncertain as the least certain one.
        soft: Standard deviation of a true contact, added in every direction.
    """
    if len(covariance) == 0:
        return math.inf
    if len(covariance) == 1:
        return _normal_quantile(miss) * math.sqrt(covariance[0, 0] + soft**2)
    # The length of r Gaussian numbers of equal variance has a chi distribution with r degrees of freedom, scaled by the
    # standard deviation. For two it is the Rayleigh distribution, whose quantile has a closed form.
    worst = max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0)
    if len(covariance) == 2:
        return math.sqrt(-2.0 * math.log(miss) * (worst + soft**2))
    return math.sqrt(_chi_square_quantile(miss, len(covariance)) * (worst + soft**2))


def compute_contact_slack(pair: FacingPair, play_m: float) -> PairThresholds:
    """Gap and tilt that a true contact with this play per side can have."""
    return PairThresholds(play_m, 2.0 * play_m * math.hypot(*(0.5 / max(half, play_m, 1e-9) for half in pair.half_m)))


def compute_contact_covariance(pair: FacingPair, play_m: float) -> Array:
    """The covariance (r, r) of gap and tilts of a true contact: uniform within its play, plus softness, [m, rad].

    r is 3 for flat faces.
    """
    # Uniform within +-p has the variance p^2 / 3; a face of half length h may tilt by p / h.
    tilts = [play_m / max(half, play_m, 1e-9) for half in pair.half_m]
    plays = [play_m] * pair.lengths + tilts
    soft = [CONTACT_SOFT_M] * pair.lengths + [_SOFT_RAD] * len(tilts)
    return np.diag([x * x / 3.0 + y * y for x, y in zip(plays, soft, strict=True)])


@lru_cache
def _chi_square_quantile(miss: float, count: int) -> float:
    from scipy.stats import chi2

    return float(chi2.isf(miss, count))


@lru_cache
def _normal_quantile(miss: float) -> float:
    from scipy.stats import norm

    return float(norm.isf(miss / 2))
