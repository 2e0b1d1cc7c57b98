"""All trials of a sweep together: a rate, and a difference to another method, with intervals over seeds.

Trials of one seed share their random numbers, in every scenario and at every level. So seeds, and not trials, are
independent: each gives one number, how many of its trials were right, and the intervals are those of the mean over
seeds. Where every seed has one trial they are Wilson's and Tango's.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.statistics.levels.bounded import mean_interval
from apo_bench.statistics.mcnemar import mcnemar
from apo_bench.statistics.paired import tango
from apo_bench.statistics.power import ERROR, least_discordant, paired_trials
from apo_bench.statistics.rates import Interval, wilson

FEWEST_SEEDS = least_discordant(ERROR)
"""With fewer, not even a difference at every seed is beyond chance: 2 / 2^n is then over 5 % (sign test)."""
_DIGITS = 12
"""Sums of the same numbers in another order are the same value to so many digits."""
Results = Mapping[tuple[Any, ...], bool]
"""All that a trial is of but the method, its seed last -> success."""


class Pooled(NamedTuple):
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
        differ = self.better + self.worse >= FEWEST_SEEDS
        if self.trials == self.seeds:
            differ = mcnemar(self.better, self.worse) <= ERROR
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


def pooled(results: Results) -> Pooled:
    """The rate of one method over all its trials, of which there is one at least."""
    by_seed = _by_seed({key: float(value) for key, value in results.items()})
    right = sum(results.values())
    trials = len(results)
    if len(by_seed.values) == trials:
        return Pooled(right, trials, trials, wilson(right, trials))
    interval = mean_interval(by_seed.values, 0.0, by_seed.most)
    return Pooled(right, trials, len(by_seed.values), Interval(interval.low, min(1.0, interval.high)))


def contrast(first: Results, second: Results) -> Contrast | None:
    """One method against another; None where they have no trial in common."""
    both = {key: float(first[key]) - float(second[key]) for key in first if key in second}
    if not both:
        return None
    by_seed = _by_seed(both)
    apart = list(both.values())
    if len(by_seed.values) == len(both):
        interval = tango(apart.count(1.0), apart.count(-1.0), len(both))
    else:
        # a seed that was not seen may differ in all of its trials
        low, high = mean_interval(by_seed.values, -by_seed.most, by_seed.most)
        interval = Interval(max(-1.0, low), min(1.0, high))
    return Contrast(
        ours=sum(first[key] for key in both),
        theirs=sum(second[key] for key in both),
        trials=len(both),
        seeds=len(by_seed.values),
        interval=interval,
        better=int((by_seed.values > 0.0).sum()),
        worse=int((by_seed.values < 0.0).sum()),
    )


class _Seeds(NamedTuple):
    values: Array
    """(seeds,) Sum over the trials of a seed, over the mean number of trials of a seed: their mean is that of all
    trials."""
    most: float
    """The largest such value that a seed could have."""


def _by_seed(values: Mapping[tuple[Any, ...], float]) -> _Seeds:
    seeds: dict[int, list[float]] = {}
    for key, value in values.items():
        seeds.setdefault(key[-1], []).append(value)
    usual = len(values) / len(seeds)
    sums = np.array([sum(seeds[seed]) / usual for seed in sorted(seeds)])
    return _Seeds(np.round(sums, _DIGITS), max(map(len, seeds.values())) / usual)
