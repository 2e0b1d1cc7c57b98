"""The level of half success: the curves, what is known of a seed's luck, estimates, intervals, sure bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit, ndtri, xlogy
from scipy.stats import binomtest

from apo_bench.statistics import threshold
from apo_bench.statistics.levels.curves import Curve, CurveSetting, curves
from apo_bench.statistics.levels.falling import CURVE_SHAPES, curve, misfit, profile, variation
from apo_bench.statistics.levels.half_level import HalfLevel, half_level, half_levels, sure
from tests.statistics.test_rates import row

LEVELS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
HERE = CurveSetting("stick_in_tower", 0.25, "isotropic", "given", 1.0, "contact")


def made(rates: tuple[float, ...], levels: tuple[float, ...] = LEVELS, seeds: int = 100) -> HalfLevel:
    """Of seeds that bear more or less: a seed that fails at one level fails at all worse ones."""
    success = np.array([[float(i < r * seeds) for r in rates] for i in range(seeds)])
    return half_level(Curve(HERE, np.array(levels), tuple(range(seeds)), success))


def test_every_curve_is_one_half_at_its_half_level_and_falls() -> None:
    x = np.linspace(-3.0, 3.0, 13)
    p = curve(x[:, None], np.array(0.5), *CURVE_SHAPES)
    assert np.allclose(curve(np.array(0.5), np.array(0.5), *CURVE_SHAPES), 0.5, atol=1e-9)
    assert np.all(np.diff(p, axis=0) <= 1e-12)
    assert np.all((p >= 0) & (p <= CURVE_SHAPES[1] + 1e-12))


@pytest.mark.parametrize(
    ("rates", "text", "interval", "surely"),
    [
        ((1, 1, 1, 1, 1, 1, 1), "> 4", "> 4", "> 4"),
        ((0, 0, 0, 0, 0, 0, 0), "none", "< 0.1", "none"),
        ((1, 0, 0, 0, 0, 0, 0), "< 0.1", "< 0.1", "0 to 0.1"),
        ((0, 0, 0, 0, 1, 1, 1), "> 4", "any", "any"),
    ],
)
def test_outside_the_levels_it_is_censored(rates: tuple[float, ...], text: str, interval: str, surely: str) -> None:
    found = made(rates)
    assert (found.level, found.text, found.interval_text, found.sure_text) == (None, text, interval, surely)


def test_where_all_turns_to_nothing_hardly_more_is_known_than_between_which_levels() -> None:
    found = made((1, 1, 1, 0, 0, 0, 0))
    assert found.low is not None
    assert found.high is not None
    assert 0.25 < found.low < 0.28 < 0.45 < found.high < 0.5
    assert found.level == pytest.approx(np.sqrt(0.25 * 0.5), rel=0.1)
    assert (found.surely_over, found.surely_under, found.sure_text) == (0.25, 0.5, "0.25 to 0.5")


def test_an_interval_may_reach_beyond_the_last_level() -> None:
    found = made((1, 1, 1, 1, 1, 0.95, 0.45))
    assert (found.beyond, found.high, found.surely_over, found.surely_under) == (None, None, 2.0, None)
    assert found.low is not None
    assert 3.0 < found.low < 4.0


def test_lapses_do_not_move_it() -> None:
    plain, lapsing = (made(tuple(c * expit(4 * np.log(1.5 / x)) for x in LEVELS[1:]), LEVELS[1:]) for c in (1.0, 0.94))
    assert plain.level == pytest.approx(1.5, rel=0.05)
    assert lapsing.level == pytest.approx(1.5, rel=0.08)


@pytest.mark.parametrize("half", [0.4, 1.2, 2.5])
def test_many_seeds_find_the_truth(half: float) -> None:
    rng = np.random.default_rng(2)
    p = expit(3 * np.log(half / np.array(LEVELS[1:])))
    found = half_level(Curve(HERE, np.array(LEVELS[1:]), tuple(range(4000)), (rng.random((4000, 6)) < p) * 1.0))
    assert found.low is not None
    assert found.high is not None
    assert found.low < half < found.high < 1.2 * found.low


def test_luck_that_levels_share_is_noticed() -> None:
    """If a seed's luck is nearly the same at every level, the half level varies more than independent trials say."""
    rng = np.random.default_rng(3)
    levels = np.log(LEVELS[1:])
    half = np.array([0.0])
    p = expit(1.5 * -levels)
    luck = rng.standard_normal((2000, 1))
    alike = (0.95 * luck + 0.31 * rng.standard_normal((2000, 6)) < ndtri(p)) * 1.0
    apart = (rng.standard_normal((2000, 6)) < ndtri(p)) * 1.0
    others = (np.array([1.5]), np.array([1.0]), np.array([1.0]))
    much, little = (float(variation(levels, y, np.ones_like(y), half, others)) for y in (alike, apart))
    assert much > 2.0
    assert 1.0 <= little < 1.15


def test_a_bad_fit_widens_the_interval() -> None:
    """Success that falls, rises and falls again: deviance that chance explains does not count, the rest does."""
    trials = np.full(6, 50.0)
    right = np.array([48.0, 20.0, 45.0, 5.0, 30.0, 1.0])
    fits = xlogy(right, right / trials) + xlogy(trials - right, 1 - right / trials)
    assert misfit(right, trials - right, fits.sum()) == 1.0
    assert misfit(right, trials - right, fits.sum() - 2.9) == 1.0
    assert misfit(right, trials - right, fits.sum() - 29.957) == pytest.approx(10.0, rel=1e-3)


def test_the_interval_is_what_is_not_surprising() -> None:
    """The study of coverage asks for the surprise at the truth; the interval is where that is below the threshold."""
    rng = np.random.default_rng(5)
    for seeds in (20, 60):
        success = (rng.random((seeds, 6)) < expit(3 * np.log(0.8 / np.array(LEVELS[1:])))) * 1.0
        found = half_level(Curve(HERE, np.array(LEVELS[1:]), tuple(range(seeds)), success))
        profiled = profile(np.log(LEVELS[1:]), success)
        for level in np.geomspace(0.11, 3.9, 40):
            at = np.interp(np.log(level), profiled.log_half, profiled.surprise)
            if abs(at - threshold(seeds)) > 1e-6:
                assert ((found.low or 0) <= level <= (found.high or 9)) == (at <= threshold(seeds))


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), factor=st.sampled_from([0.25, 3.0]))
def test_it_knows_no_unit_and_no_order_of_seeds(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    success = (rng.random((30, 5)) < np.sort(rng.random(5))[::-1]) * 1.0
    levels = np.array([0.1, 0.3, 1.0, 2.0, 5.0])
    a = half_level(Curve(HERE, levels, tuple(range(30)), success))
    b = half_level(Curve(HERE, factor * levels, tuple(range(30)), rng.permutation(success)))
    assert a.beyond == b.beyond
    for one, other in ((a.level, b.level), (a.low, b.low), (a.high, b.high)):
        assert (one is None) == (other is None)
        assert one is None or factor * one == pytest.approx(other, rel=1e-3)


@settings(max_examples=40, deadline=None)
@given(right=st.lists(st.integers(0, 30), min_size=1, max_size=6))
def test_sure_bounds_stop_at_the_first_test_that_does_not_reject(right: list[int]) -> None:
    over, under = map(int, sure(np.array(right), np.full(len(right), 30)))
    greater = [binomtest(k, 30, alternative="greater").pvalue <= 0.025 for k in right]
    less = [binomtest(k, 30, alternative="less").pvalue <= 0.025 for k in right][::-1]
    assert over == (greater.index(False) if False in greater else len(greater))
    assert under == (less.index(False) if False in less else len(less))


def test_curves_come_from_rows_in_any_order_with_what_is_missing() -> None:
    rows = [row("contact", seed, seed > 2, level=x, level_deg=x) for seed in range(8) for x in (0.5, 1.0)]
    rows += [row("contact", 0, None, level=2.0, level_deg=2.0), row("contact", 1, level=2.0, level_deg=2.0)]
    rows += [row("contact", 9, level=4.0, level_deg=1.0), row("oracle"), row("paper", 1)]
    (found,) = curves(rows)
    assert (found.setting, found.levels.tolist(), len(found.seeds)) == (HERE, [0.5, 1.0, 2.0], 8)
    assert np.isnan(found.success[:, 2]).tolist() == [True, False] + 6 * [True]
    assert half_levels(curves(rows[::-1])) == half_levels([found])


def test_the_range_finders_level_is_in_mm_alone() -> None:
    rows = [row("contact", 0, noise="range", level=x, level_deg=0.0) for x in (1.0, 2.0)]
    assert [c.levels.tolist() for c in curves(rows)] == [[1.0, 2.0]]
