"""Rates and differences over all trials of a sweep, with confidence intervals over seeds.

All trials of one seed share their random numbers, in every scenario and at every noise level, so only seeds are
independent. Each seed gives one number: how many of its trials succeeded. The intervals are those of the mean over
seeds. If every seed has one trial, they are Wilson's and Tango's intervals.

The interval of a mean is that of A. B. Owen's empirical likelihood (Biometrika 75, 1988, 237-249), which assumes no
distribution. The numbers of seeds lie between two bounds. The interval contains each mean for which the likeliest
distribution between the bounds is not much less likely than the sample. Unlike Owen's, the distribution may put
probability on the bounds even if no seed is there, so equal seeds still give an interval. Twice the log likelihood
ratio is compared with Fisher's F with 1 and n - 1 degrees of freedom (Owen's advice).
"""

from typing import NamedTuple

import numpy as np

from apo_bench.benchmark.analysis.paired import compute_mcnemar_p_value, compute_tango_interval
from apo_bench.benchmark.analysis.rates import CONFIDENCE, Interval, compute_wilson_interval
from apo_bench.geometry import Array
from apo_bench.records.run.trials import Index

ERROR = 0.05
"""Significance level of a two-sided test."""
FEWEST_SEEDS = 6
"""With fewer seeds, even a difference at every seed may be chance: 2 / 2^n is above 5 % (sign test)."""
_DIGITS = 12
"""Sums are rounded to this many digits, so that the order of summation does not matter."""
_EDGE = 1e-9
"""The search for a mean stops this share of the interval before a bound, where the likelihood ratio is infinite."""


class Results(NamedTuple):
    """The trials of one method that count."""

    trial: Index
    """(n,): number of the trial without its method; equal numbers of two methods are paired."""
    seed: Array
    """(n,)."""
    success: Array
    """(n,): 1 or 0."""


class PooledRate(NamedTuple):
    """The success rate of a method over all its trials."""

    right: int
    trials: int
    seeds: int
    interval: Interval
    """Confidence interval of the rate; 0 to 1 for a single seed with several trials."""


class Contrast(NamedTuple):
    """Two methods, compared over the trials that both have."""

    ours: int
    """Successes of the first method."""
    theirs: int  # successes of the second method
    trials: int
    seeds: int
    interval: Interval
    """Confidence interval of the difference of the two rates, first minus second."""
    better: int
    """Seeds at which the first method succeeded in more trials."""
    worse: int  # seeds at which it succeeded in fewer

    @property
    def difference(self) -> float:
        """Success rate of the first method minus that of the second."""
        return (self.ours - self.theirs) / self.trials

    @property
    def sure(self) -> bool:
        """Whether the difference is significant: 0 is outside the interval, and enough seeds differ for a sign test."""
        by_chance = compute_mcnemar_p_value(self.better, self.worse) > ERROR
        # with one trial per seed, McNemar's test is the sign test
        differ = not by_chance if self.trials == self.seeds else self.better + self.worse >= FEWEST_SEEDS
        return differ and not self.interval.low <= 0.0 <= self.interval.high


def pool_rate(results: Results) -> PooledRate:
    """Return the success rate of a method over all its trials, of which there must be at least one."""
    values, most = _sum_by_seed(results.seed, results.success)  # successes per seed, and the most possible
    right = int(results.success.sum())
    trials = len(results.seed)
    low, high = compute_wilson_interval(right, trials) if len(values) == trials else mean_interval(values, 0.0, most)
    return PooledRate(right, trials, len(values), Interval(low, min(1.0, high)))


def contrast(first: Results, second: Results) -> Contrast | None:
    """Compare two methods; None if they have no trial in common."""
    _, i, j = np.intersect1d(first.trial, second.trial, return_indices=True)
    if not len(i):
        return None
    ours = first.success[i]
    theirs = second.success[j]
    apart = ours - theirs  # 1, 0 or -1 per trial
    values, most = _sum_by_seed(first.seed[i], apart)
    if len(values) == len(apart):
        interval = compute_tango_interval(int((apart > 0).sum()), int((apart < 0).sum()), len(apart))
    else:
        # a seed that was not drawn may differ in all of its trials, so the bounds are -most and most
        interval = Interval(*np.clip(mean_interval(values, -most, most), -1.0, 1.0).tolist())
    return Contrast(
        ours=int(ours.sum()),
        theirs=int(theirs.sum()),
        trials=len(apart),
        seeds=len(values),
        interval=interval,
        better=int((values > 0.0).sum()),
        worse=int((values < 0.0).sum()),
    )


def compute_threshold(seeds: int) -> float:
    """Return the 95 % quantile of twice the log likelihood ratio; infinite with fewer than two seeds."""
    from scipy.special import fdtri

    return float(fdtri(1, seeds - 1, CONFIDENCE)) if seeds > 1 else float("inf")


def compute_mean_surprise(values: Array, counts: Array, mean: float, low: float = 0.0, high: float = 1.0) -> float:
    """Return twice the log likelihood ratio of a mean; 0 at the mean of the sample.

    The likeliest weights are n_i / (n (1 + a (x_i - mean))); the probability that they leave lies on a bound. Twice the
    log ratio is the maximum of 2 sum n_i log(1 + a (x_i - mean)) over a. The weights must be positive at both bounds.

    Args:
        values: Distinct values, (k,), from `low` to `high`.
        counts: Number of seeds with each value, (k,).
        mean: The mean to test, strictly between `low` and `high`.
    """
    from scipy.optimize import minimize_scalar

    # 1 + a (x - mean) > 0 at x = high and at x = low bounds the multiplier a from both sides; the sum is concave in a
    bounds = (-1.0 / (high - mean), 1.0 / (mean - low))
    best = minimize_scalar(
        lambda a: -2.0 * float((counts * np.log(np.maximum(1.0 + a * (values - mean), 1e-300))).sum()),
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-12 * (bounds[1] - bounds[0])},
    )
    return max(0.0, -float(best.fun))


def mean_interval(values: Array, low: float = 0.0, high: float = 1.0) -> Interval:
    """Return the 95 % confidence interval of a mean by empirical likelihood; the whole range without a value.

    Args:
        values: One value per seed, (n,), from `low` to `high`.
    """
    if len(values) == 0:
        return Interval(low, high)
    different, counts = np.unique(np.asarray(values, dtype=float), return_counts=True)
    mean = float(np.clip((different * counts).sum() / counts.sum(), low, high))
    sample = (different, counts.astype(float), low, high)
    return Interval(_find_interval_end(*sample, mean, low), _find_interval_end(*sample, mean, high))


def _find_interval_end(values: Array, counts: Array, low: float, high: float, inside: float, outside: float) -> float:
    """Return the end of the interval between the mean of the sample (`inside`) and a bound (`outside`)."""
    from scipy.optimize import brentq

    most = compute_threshold(int(counts.sum()))
    edge = _EDGE * (outside - inside)
    # the bound itself is not excluded
    if edge == 0.0 or compute_mean_surprise(values, counts, outside - edge, low, high) <= most:
        return outside
    ends = inside + edge, outside - edge
    return float(brentq(lambda mean: compute_mean_surprise(values, counts, mean, low, high) - most, *ends, xtol=1e-9))


def _sum_by_seed(seeds: Array, results: Array) -> tuple[Array, float]:
    """Return the sum of the results of each seed, (seeds,), and the largest sum that a seed could have.

    Both are divided by the mean number of trials of a seed, so that the mean over seeds equals the mean over trials.
    """
    _, of, trials = np.unique(seeds, return_inverse=True, return_counts=True)
    usual = len(seeds) / len(trials)  # mean number of trials of a seed
    return np.round(np.bincount(of, results) / usual, _DIGITS), float(trials.max() / usual)
