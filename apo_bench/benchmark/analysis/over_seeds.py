"""Rates and differences over all trials of a sweep, with intervals over seeds.

Trials of one seed share their random numbers, in every scenario and at every noise level. So seeds, and not trials, are
independent: each gives one number, how many of its trials succeeded, and the intervals are those of the mean over
seeds. Where every seed has one trial they are Wilson's and Tango's.

The interval of a mean assumes no distribution. Each seed gives one number between two bounds. It holds the means whose
likeliest distribution between the bounds is not much less likely than the sample: A. B. Owen's empirical likelihood
(Biometrika 75, 1988, 237-249), except that the bounds may carry probability though no seed was there, so that a sample
in which all seeds are equal still has an interval. Twice the log ratio is compared with Fisher's F with 1 and n - 1
degrees of freedom (Owen's advice).
"""

from typing import NamedTuple

import numpy as np

from apo_bench.benchmark.analysis.paired import compute_tango_interval, mcnemar
from apo_bench.benchmark.analysis.rates import CONFIDENCE, Interval, compute_wilson_interval
from apo_bench.geometry import Array
from apo_bench.records.run.trials import Index

ERROR = 0.05
"""Of a two-sided test."""
FEWEST_SEEDS = 6
"""With fewer, not even a difference at every seed is beyond chance: 2 / 2^n is then over 5 % (sign test)."""
_DIGITS = 12
"""Sums of the same numbers in another order are the same value to so many digits."""
_EDGE = 1e-9
"""A mean is not sought closer to a bound than this part of the way."""


class Results(NamedTuple):
    """The trials of one method that count."""

    trial: Index
    """(n,) a number for all that a trial is of but the method."""
    seed: Array
    """(n,)"""
    success: Array
    """(n,) 1 or 0."""


class PooledRate(NamedTuple):
    """How often a method was right."""

    right: int
    trials: int
    seeds: int
    interval: Interval
    """Of the rate; from 0 to 1 with a single seed that has several trials."""


class Contrast(NamedTuple):
    """Two methods over the trials that both have."""

    ours: int
    """Trials in which the first was right."""
    theirs: int
    trials: int
    seeds: int
    interval: Interval
    """Of the difference of the two rates, first minus second."""
    better: int
    """Seeds of which the first was right in more trials."""
    worse: int

    @property
    def difference(self) -> float:
        """Rate of the first minus that of the second."""
        return (self.ours - self.theirs) / self.trials

    @property
    def sure(self) -> bool:
        """Whether it is beyond chance: 0 is outside the interval, and seeds enough for a sign test differ."""
        by_chance = mcnemar(self.better, self.worse) > ERROR
        differ = not by_chance if self.trials == self.seeds else self.better + self.worse >= FEWEST_SEEDS
        return differ and not self.interval.low <= 0.0 <= self.interval.high


def pool_rate(results: Results) -> PooledRate:
    """The rate of one method over all its trials, of which there is one at least."""
    values, most = _by_seed(results.seed, results.success)
    right = int(results.success.sum())
    trials = len(results.seed)
    low, high = compute_wilson_interval(right, trials) if len(values) == trials else mean_interval(values, 0.0, most)
    return PooledRate(right, trials, len(values), Interval(low, min(1.0, high)))


def contrast(first: Results, second: Results) -> Contrast | None:
    """One method against another; None where they have no trial in common."""
    _, i, j = np.intersect1d(first.trial, second.trial, return_indices=True)
    if not len(i):
        return None
    ours = first.success[i]
    theirs = second.success[j]
    apart = ours - theirs
    values, most = _by_seed(first.seed[i], apart)
    if len(values) == len(apart):
        interval = compute_tango_interval(int((apart > 0).sum()), int((apart < 0).sum()), len(apart))
    else:
        # a seed that was not seen may differ in all of its trials
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
    """What twice the log likelihood ratio stays below in 95 of 100 samples; infinite with a single seed or none."""
    from scipy.special import fdtri

    return float(fdtri(1, seeds - 1, CONFIDENCE)) if seeds > 1 else float("inf")


def compute_mean_surprise(values: Array, counts: Array, mean: float, low: float = 0.0, high: float = 1.0) -> float:
    """Twice the log likelihood ratio of a mean, 0 at the mean of the sample.

    The likeliest weights are n_i / (n (1 + a (x_i - mean))); what they leave over lies on a bound. Twice the log ratio
    is the largest 2 sum n_i log(1 + a (x_i - mean)) over all a that keep the weights positive at both bounds.

    Args:
        values: (k,) from `low` to `high`.
        counts: (k,) how many seeds had each value.
        mean: Strictly between `low` and `high`.
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
    """The 95 % confidence interval of a mean by empirical likelihood, which needs no normal distribution.

    It is the whole range without a value.

    Args:
        values: (n,) from `low` to `high`, one per seed.
    """
    if len(values) == 0:
        return Interval(low, high)
    different, counts = np.unique(np.asarray(values, dtype=float), return_counts=True)
    mean = float(np.clip((different * counts).sum() / counts.sum(), low, high))
    sample = (different, counts.astype(float), low, high)
    return Interval(_end(*sample, mean, low), _end(*sample, mean, high))


def _end(values: Array, counts: Array, low: float, high: float, inside: float, outside: float) -> float:
    """Where between the mean of the sample and a bound the surprise reaches its threshold."""
    from scipy.optimize import brentq

    most = compute_threshold(int(counts.sum()))
    edge = _EDGE * (outside - inside)
    if edge == 0.0 or compute_mean_surprise(values, counts, outside - edge, low, high) <= most:
        return outside
    ends = inside + edge, outside - edge
    return float(brentq(lambda mean: compute_mean_surprise(values, counts, mean, low, high) - most, *ends, xtol=1e-9))


def _by_seed(seeds: Array, results: Array) -> tuple[Array, float]:
    """The sum over the trials of each seed, (seeds,), and the largest that one could have.

    Both over the mean number of trials of a seed, so that the mean over seeds is that over trials.
    """
    _, of, trials = np.unique(seeds, return_inverse=True, return_counts=True)
    usual = len(seeds) / len(trials)
    return np.round(np.bincount(of, results) / usual, _DIGITS), float(trials.max() / usual)
