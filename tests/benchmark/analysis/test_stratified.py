"""Rates and differences over independent conditions: special cases that have formulas, and their coverage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import beta

from apo_bench.benchmark.analysis import (
    compute_tango_interval,
    compute_wilson_interval,
    measure_mean_difference,
    measure_mean_rate,
    pool_estimates,
)
from apo_bench.geometry import Array

DRAWS = 400
"""Draws of a simulation; the mean over rates has a standard error of 0.4 points."""
RATES = (0.05, 0.1, 0.3, 0.5, 0.8, 0.9, 0.97)


def test_one_condition_has_the_intervals_of_the_tables() -> None:
    results = np.array([1.0] * 17 + [0.0] * 3)
    assert measure_mean_rate([results]).interval == pytest.approx(compute_wilson_interval(17, 20), abs=1e-12)
    apart = np.array([1.0] * 5 + [-1.0] * 2 + [0.0] * 13)
    found = measure_mean_difference([apart])
    assert found is not None
    assert found.value == pytest.approx(3 / 20)
    assert found.interval == pytest.approx(compute_tango_interval(5, 2, 20), abs=1e-12)
    assert found.p == pytest.approx(0.2568, abs=1e-4)  # McNemar's statistic is 9/7


def test_unequal_conditions_are_known_better_than_equal_ones() -> None:
    half = np.repeat([1.0, 0.0], 10)
    equal, unequal = measure_mean_rate([half, half]), measure_mean_rate([half[:10], half[10:]])
    assert equal.value == unequal.value == 0.5
    # without variance in a condition, the effective number is that of the trials; ten times it is the most
    assert unequal.interval == pytest.approx(compute_wilson_interval(10, 20))
    almost = measure_mean_rate([np.repeat([1.0, 0.0], [99, 1]), np.repeat([1.0, 0.0], [1, 99])])
    assert almost.interval == pytest.approx(compute_wilson_interval(1000, 2000))


def test_nothing_is_known_without_a_trial() -> None:
    assert measure_mean_rate([np.zeros(0)]).interval == (0.0, 1.0)
    assert measure_mean_difference([np.zeros(0)]) is None


def test_a_mean_of_two_equal_estimates_has_an_interval_narrower_by_the_root_of_two() -> None:
    one = measure_mean_rate([np.repeat([1.0, 0.0], 50)])
    low, high = pool_estimates([one, one]).interval
    assert high - low == pytest.approx((one.interval.high - one.interval.low) / np.sqrt(2))


def spread(rate: float, conditions: int) -> Array:
    """The rates of conditions, as unequal as a Beta distribution that has most of its mass at its ends."""
    return np.asarray(beta.ppf((np.arange(conditions) + 0.5) / conditions, rate, 1.0 - rate))


@pytest.mark.parametrize("unequal", [False, True])
def test_the_interval_of_a_rate_covers_it_as_often_as_it_states(unequal: bool) -> None:
    rng = np.random.default_rng(0)
    covered = []
    for rate in RATES:
        rates = spread(rate, 16) if unequal else np.full(16, rate)
        truth = rates.mean()
        for _ in range(DRAWS):
            low, high = measure_mean_rate(list((rng.random((16, 10)) < rates[:, None]).astype(float))).interval
            covered.append(low <= truth <= high)
    assert 0.93 <= np.mean(covered) <= 0.98
    assert measure_mean_rate(list(np.ones((16, 10)))).interval.high == 1.0
    assert measure_mean_rate(list(np.zeros((16, 10)))).interval.low == 0.0
