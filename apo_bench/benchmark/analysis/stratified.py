"""Rates and paired differences over conditions whose trials are independent, as those of a track are.

Every condition counts equally, so the mean over conditions varies less than the rate of as many trials of one
condition. Wilson's and Tango's intervals take this into account by an effective number of trials: the number of equal
trials whose rate has the estimated variance of the mean (L. Kish, Survey Sampling, 1965). It lies between the number of
trials and ten times that number, so that a variance that is estimated too small has a limited effect.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.benchmark.analysis.paired import compute_tango_interval
from apo_bench.benchmark.analysis.rates import Interval, compute_wilson_interval
from apo_bench.geometry import Array

_MOST_GAIN = 10.0
"""Largest effective number of trials, over the number of trials."""


class MeanEstimate(NamedTuple):
    """A rate, or a difference of two rates, over several conditions."""

    value: float
    interval: Interval
    null_variance: float
    """Variance of a difference if both rates are equal; 0 for a rate."""

    @property
    def p(self) -> float:
        """Two-sided p-value of a difference: McNemar's score test at the effective number of pairs."""
        from scipy.special import ndtr

        return float(2.0 * ndtr(-abs(self.value) / np.sqrt(self.null_variance))) if self.null_variance > 0.0 else 1.0


def measure_mean_rate(conditions: Sequence[Array]) -> MeanEstimate:
    """Return the mean over conditions of the success rate, with Wilson's interval at the effective number of trials.

    Without a trial it is 0, between 0 and 1.

    Args:
        conditions: The results of each condition, (n,): 1 or 0. Conditions without a trial are left out.
    """
    known = [results for results in conditions if len(results)]
    if not known:
        return MeanEstimate(0.0, Interval(0.0, 1.0), 0.0)
    rate = float(np.mean([results.mean() for results in known]))
    n = _count_effective(known, rate * (1.0 - rate))
    return MeanEstimate(rate, compute_wilson_interval(rate * n, n), 0.0)


def measure_mean_difference(conditions: Sequence[Array]) -> MeanEstimate | None:
    """Return the mean over conditions of the difference of two success rates, with Tango's interval; None without any.

    Args:
        conditions: The first result minus the second one in each trial that both have, (n,): 1, 0 or -1.
    """
    known = [apart for apart in conditions if len(apart)]
    if not known:
        return None
    only_first, only_second = (float(np.mean([(apart == sign).mean() for apart in known])) for sign in (1, -1))
    value = only_first - only_second
    n = _count_effective(known, only_first + only_second - value**2)
    interval = compute_tango_interval(only_first * n, only_second * n, n)
    return MeanEstimate(value, interval, (only_first + only_second) / n)


def pool_estimates(estimates: Sequence[MeanEstimate]) -> MeanEstimate:
    """Return the mean of independent estimates, at least one; the parts of their intervals add as squares.

    After R. G. Newcombe, Interval estimation for the difference between independent proportions, Statistics in Medicine
    17 (1998), 873-890, method 10, for a mean.
    """
    many = len(estimates)
    values: Array = np.array([(each.value, *each.interval) for each in estimates])
    value = float(values[:, 0].mean())
    below, above = (float(np.linalg.norm(values[:, 0] - values[:, i])) / many for i in (1, 2))
    return MeanEstimate(
        value, Interval(value - below, value + above), sum(each.null_variance for each in estimates) / many**2
    )


def _count_effective(conditions: Sequence[Array], variance: float) -> float:
    """Return the effective number of trials: the variance of one trial over that of the mean over conditions.

    Args:
        conditions: The results of each condition, (n,), at least one each.
        variance: Variance of a trial of an unknown condition.
    """
    counts = np.array([len(results) for results in conditions])
    # the number of trials, where all conditions have equally many
    least = len(counts) ** 2 / float((1.0 / counts).sum())
    if counts.min() < 2:
        return least
    own = sum(results.var(ddof=1) / len(results) for results in conditions) / len(counts) ** 2
    return float(np.clip(variance / own if own > 0.0 else least, least, _MOST_GAIN * least))
