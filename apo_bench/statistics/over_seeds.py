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

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.io import grouped
from apo_bench.statistics.paired import mcnemar, tango
from apo_bench.statistics.power import ERROR, least_discordant, paired_trials
from apo_bench.statistics.rates import CONFIDENCE, Interval, wilson

FEWEST_SEEDS = least_discordant(ERROR)
"""With fewer, not even a difference at every seed is beyond chance: 2 / 2^n is then over 5 % (sign test)."""
_DIGITS = 12
"""Sums of the same numbers in another order are the same value to so many digits."""
_HALVINGS = 48
"""What is left is less than 1e-14 of the range."""
Results = Mapping[tuple[Any, ...], bool]
"""All that a trial is of but the method, its seed last -> success."""


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

    @property
    def enough(self) -> int | None:
        """Seeds at which a sign test would show who is better, if as many of them differ as here; None: not known."""
        win = self.better / self.seeds
        lose = self.worse / self.seeds
        if (win - lose) * self.difference <= 0.0:
            return None
        try:
            return paired_trials(win, lose)
        except InputError:  # more than can be sought
            return None


def pooled_rate(results: Results) -> PooledRate:
    """The rate of one method over all its trials, of which there is one at least."""
    values, most = _by_seed({key: float(value) for key, value in results.items()})
    right = sum(results.values())
    interval = wilson(right, len(results)) if len(values) == len(results) else mean_interval(values, 0.0, most)
    return PooledRate(right, len(results), len(values), Interval(interval.low, min(1.0, interval.high)))


def contrast(first: Results, second: Results) -> Contrast | None:
    """One method against another; None where they have no trial in common."""
    both = {key: float(first[key]) - float(second[key]) for key in first if key in second}
    if not both:
        return None
    values, most = _by_seed(both)
    apart = list(both.values())
    if len(values) == len(both):
        interval = tango(apart.count(1.0), apart.count(-1.0), len(both))
    else:
        # a seed that was not seen may differ in all of its trials
        interval = Interval(*np.clip(mean_interval(values, -most, most), -1.0, 1.0).tolist())
    return Contrast(
        ours=sum(first[key] for key in both),
        theirs=sum(second[key] for key in both),
        trials=len(both),
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
    if inside == outside:
        return outside
    most = threshold(int(counts.sum()))
    parts = np.linspace(0.0, 1.0, 34)[1:-1]
    # six times one of 33 pieces is kept: 33^-6 of the way, 1e-9
    for _ in range(6):
        means = inside + parts * (outside - inside)
        believed = int((mean_surprise(values, counts, means, low, high) <= most).sum())
        inside, outside = ((inside, *means, outside)[i] for i in (believed, believed + 1))
    return float(inside)


def _by_seed(values: Mapping[tuple[Any, ...], float]) -> tuple[Array, float]:
    """(seeds,) the sum over the trials of a seed, over the mean number of trials of a seed, so that their mean is that
    of all trials; and the largest such value that a seed could have."""
    seeds = grouped((key[-1], value) for key, value in values.items())
    usual = len(values) / len(seeds)
    return np.round(np.array([sum(seeds[seed]) / usual for seed in sorted(seeds)]), _DIGITS), max(
        map(len, seeds.values())
    ) / usual
