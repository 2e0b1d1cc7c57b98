"""The mean of a bounded quantity: its likelihood interval against formulas, against statsmodels, and its laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.emplike.descriptive import DescStat

from apo_bench.benchmark.analysis import compute_mean_surprise, compute_threshold
from apo_bench.benchmark.analysis.over_seeds import mean_interval

STEPS = st.lists(st.integers(0, 20), min_size=2, max_size=40)
"""Numbers from 0 to 1 in twentieths: such that ties and bounds happen."""


@pytest.mark.parametrize(("k", "n", "p"), [(3, 10, 0.5), (0, 20, 0.1), (20, 20, 0.8), (97, 100, 0.9)])
def test_of_zeros_and_ones_it_is_the_binomial_likelihood(k: int, n: int, p: float) -> None:
    def part(count: int, rate: float) -> float:
        return count * math.log(count / n / rate) if count else 0.0

    found = float(compute_mean_surprise(np.array([0.0, 1.0]), np.array([n - k, k]), p))
    assert found == pytest.approx(2 * (part(k, p) + part(n - k, 1 - p)), rel=1e-6)


@pytest.mark.filterwarnings("ignore::FutureWarning")
@pytest.mark.parametrize("mean", [0.45, 0.5, 0.55])
def test_between_the_values_it_is_owens_empirical_likelihood(mean: float) -> None:
    x = np.random.default_rng(4).beta(2.0, 2.0, 30)
    expected = DescStat(x).test_mean(mean)[0]
    assert float(compute_mean_surprise(x, np.ones_like(x), mean)) == pytest.approx(expected, rel=1e-6)


def test_few_seeds_are_held_against_students_t() -> None:
    from scipy.stats import t

    assert compute_threshold(8) == pytest.approx(t.ppf(0.975, 7) ** 2)
    assert compute_threshold(100_000) == pytest.approx(3.8415, abs=1e-3)
    assert compute_threshold(1) == compute_threshold(0) == math.inf


@settings(max_examples=30, deadline=None)
@given(steps=STEPS)
def test_it_holds_the_mean_and_turns_round_with_the_values(steps: list[int]) -> None:
    x = np.array(steps) / 20
    low, high = mean_interval(x)
    assert 0.0 <= low <= x.mean() + 1e-12
    assert x.mean() - 1e-12 <= high <= 1.0
    assert mean_interval(1.0 - x) == pytest.approx((1 - high, 1 - low), abs=1e-6)
    assert mean_interval(x[::-1]) == (low, high)
