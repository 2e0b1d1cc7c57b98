"""The level of half success: estimates and sure bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit
from scipy.stats import binomtest

from apo_bench.benchmark.analysis import HalfLevel, tally
from apo_bench.benchmark.analysis.half_level import count_sure_levels, estimate_half_levels
from tests.benchmark.analysis.test_rates import row

LEVELS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


def made(rates: tuple[float, ...], levels: tuple[float, ...] = LEVELS, seeds: int = 40) -> HalfLevel:
    """Of seeds that bear more or less: a seed that fails at one level fails at all worse ones."""
    pairs = zip(levels, rates, strict=True)
    rows = [row("contact", i, i < r * seeds, noise_mm=x, noise_deg=x) for x, r in pairs for i in range(seeds)]
    (found,) = estimate_half_levels(tally(rows))
    return found


@pytest.mark.parametrize(
    ("rates", "text", "surely"),
    [
        ((1, 1, 1, 1, 1, 1, 1), "> 4", "> 4"),
        ((0, 0, 0, 0, 0, 0, 0), "< 0.1", "< 0"),
        ((1, 0, 0, 0, 0, 0, 0), "< 0.1", "0 to 0.1"),
        ((0, 0, 0, 0, 0, 1, 1), "< 0.1", "any"),
    ],
)
def test_outside_the_levels_it_is_censored(rates: tuple[float, ...], text: str, surely: str) -> None:
    found = made(rates)
    assert (found.noise_mm, found.text, found.sure_text) == (None, text, surely)


@pytest.mark.parametrize("half", [0.4, 1.2, 2.5])
def test_many_seeds_find_the_truth(half: float) -> None:
    found = made(tuple(expit(3 * np.log(half / np.array(LEVELS[1:])))), LEVELS[1:], 400)
    assert found.noise_mm == pytest.approx(half, rel=0.05)
    assert (found.surely_over or 0.0) < half < (found.surely_under or 9.0)


@settings(max_examples=15, deadline=None)
@given(right=st.lists(st.integers(0, 20), min_size=5, max_size=5), factor=st.sampled_from([0.25, 3.0]))
def test_it_knows_no_unit(right: list[int], factor: float) -> None:
    levels = (0.1, 0.3, 1.0, 2.0, 5.0)
    rates = tuple(k / 20 for k in right)
    a = made(rates, levels, 20)
    b = made(rates, tuple(factor * x for x in levels), 20)
    assert a.beyond == b.beyond
    assert (a.noise_mm is None) == (b.noise_mm is None)
    assert a.noise_mm is None or factor * a.noise_mm == pytest.approx(b.noise_mm)


@settings(max_examples=40, deadline=None)
@given(right=st.lists(st.integers(0, 30), min_size=1, max_size=6))
def test_sure_bounds_stop_at_the_first_test_that_does_not_reject(right: list[int]) -> None:
    over, under = map(int, count_sure_levels(np.array(right), np.full(len(right), 30)))
    greater = [binomtest(k, 30, alternative="greater").pvalue <= 0.025 for k in right]
    less = [binomtest(k, 30, alternative="less").pvalue <= 0.025 for k in right][::-1]
    assert over == (greater.index(False) if False in greater else len(greater))
    assert under == (less.index(False) if False in less else len(less))
