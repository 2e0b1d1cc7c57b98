"""All trials of a sweep together: a rate, and a difference to another method, with intervals over seeds.

Trials of one seed share their random numbers, in every scenario and at every level. So seeds, and not trials, are
independent: each gives one number, how many of its trials were right, and the intervals are those of the mean over
seeds. Where every seed has one trial they are Wilson's and Tango's.

The interval of a mean asks for no distribution. Each seed gives one number between two bounds. A mean is believed
unless the likeliest distribution between the bounds that has it is much less likely than what was seen. That is A. B.
Owen's empirical likelihood (Biometrika 75, 1988, 237-249), except that the bounds themselves may carry probability
though no seed was there, so that a sample in which all seeds are alike still has an interval. Twice the log ratio is
held against Fisher's F with 1 and n - 1 degrees of freedom, which for many seeds is the chi-square of Wilks' theorem
and for few is what Student's t would ask for (Owen's advice).
"""

from typing import NamedTuple

import numpy as np

from apo_bench.benchmark.analysis.paired import mcnemar, tango
from apo_bench.benchmark.analysis.rates import CONFIDENCE, Interval, wilson
from apo_bench.geometry import Array
from apo_bench.records.run.trials import Index

ERROR = 0.05
"""Of a two-sided test."""
FEWEST_SEEDS = 6
"""With fewer, not even a difference at every seed is beyond chance: 2 / 2^n is then over 5 % (sign test)."""
_DIGITS = 12
"""Sums of the same numbers in another order are the same value to so many digits."""
_HALVINGS = 48
"""What is left is less than 1e-14 of the range."""
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


def pooled_rate(results: Results) -> PooledRate:
    """The rate of one method over all its trials, of which there is one at least."""
    values, most = _by_seed(results.seed, results.success)
    right = int(results.success.sum())
    trials = len(results.seed)
    low, high = wilson(right, trials) if len(values) == trials else mean_interval(values, 0.0, most)
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
        interval = tango(int((apart > 0).sum()), int((apart < 0).sum()), len(apart))
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


def threshold(seeds: int) -> float:
    """What twice the log likelihood ratio stays below in 95 of 100 samples; infinite with a single seed or none."""
    from scipy.special import fdtri

    return float(fdtri(1, seeds - 1, CONFIDENCE)) if seeds > 1 else float("inf")


def mean_surprise(
    values: Array, counts: Array, mean: Array | float, low: Array | float = 0.0, high: Array | float = 1.0
) -> Array:
    """Twice the log likelihood ratio of a mean.

    The likeliest weights are n_i / (n (1 + a (x_i - mean))); what they leave over lies on a bound. Twice the log ratio
    is the largest 2 sum n_i log(1 + a (x_i - mean)) over all a that keep the weights positive at both bounds.

    Args:
        values: (..., k) from `low` to `high`.
        counts: (..., k) how many seeds had each value.
        mean: (...), strictly between `low` and `high`, which are (...) too, or numbers.

    Returns:
        (...), 0 where the mean is that of the sample.
    """
    z = values - np.asarray(mean)[..., None]
    # 1 + a (x - mean) > 0 at x = high and at x = low bounds the multiplier a from both sides
    least = np.broadcast_to(-1.0 / (high - np.asarray(mean)), z.shape[:-1]).copy()
    most = np.broadcast_to(1.0 / (np.asarray(mean) - low), z.shape[:-1]).copy()
    for _ in range(_HALVINGS):
        a = 0.5 * (least + most)
        # the sum is concave in a: where its derivative is above 0 the largest value lies further up
        rising = (counts * z / np.where(counts > 0, 1.0 + a[..., None] * z, 1.0)).sum(-1) > 0.0
        least = np.where(rising, a, least)
        most = np.where(rising, most, a)
    # values that no seed had count as log(1) = 0, also those at which the bound for a makes it log(0)
    factor = np.where(counts > 0, 1.0 + (0.5 * (least + most))[..., None] * z, 1.0)
    return np.asarray(2.0 * (counts * np.log(np.maximum(factor, 1e-300))).sum(-1))


def mean_interval(values: Array, low: float = 0.0, high: float = 1.0) -> Interval:
    """The means that are not too surprising at 95 %; nothing is known without a value.

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

    most = threshold(int(counts.sum()))

    def beyond(mean: float) -> float:
        return float(mean_surprise(values, counts, mean, low, high)) - most

    edge = _EDGE * (outside - inside)
    if edge == 0.0 or beyond(outside - edge) <= 0.0:
        return outside
    return float(brentq(beyond, inside + edge, outside - edge, xtol=1e-9))


def _by_seed(seeds: Array, results: Array) -> tuple[Array, float]:
    """The sum over the trials of each seed, (seeds,), and the largest that one could have.

    Both over the mean number of trials of a seed, so that the mean over seeds is that over trials.
    """
    _, of, trials = np.unique(seeds, return_inverse=True, return_counts=True)
    usual = len(seeds) / len(trials)
    return np.round(np.bincount(of, results) / usual, _DIGITS), float(trials.max() / usual)
