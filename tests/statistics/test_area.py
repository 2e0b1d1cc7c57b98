"""The area under success over level, and differences over the same seeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.statistics.levels.curves import Curve, CurveSetting, area, area_differences, areas, reach, weights
from apo_bench.statistics.over_seeds import mean_interval
from tests.statistics.test_half_level import HERE

LEVELS = np.array([0.0, 0.1, 0.4, 1.0, 4.0])


def drawn(seed: int, method: str = "contact", shift: float = 0.0, seeds: int = 30) -> Curve:
    """Seeds with luck of their own, the same for every method of one `seed`."""
    luck = np.random.default_rng(seed).random((seeds, 1))
    success = (luck < 1.0 / (1.0 + (LEVELS + shift) ** 2)) * 1.0
    return Curve(HERE._replace(method=method), LEVELS, tuple(range(seeds)), success)


def test_it_is_the_trapezoid_rule_over_the_logarithm_of_the_level() -> None:
    found = area(drawn(1))
    mean = drawn(1).success.mean(axis=0)[1:]
    assert found.area == pytest.approx(np.trapezoid(mean, np.log(LEVELS[1:])) / np.log(40.0))
    assert weights(LEVELS[1:]).sum() == pytest.approx(1.0)
    assert (found.seeds, found.levels) == (30, (0.1, 0.4, 1.0, 4.0))


def test_all_right_is_one_and_all_wrong_is_none_with_intervals() -> None:
    whole = area(Curve(HERE, LEVELS, tuple(range(40)), np.ones((40, 5))))
    nothing = area(Curve(HERE, LEVELS, tuple(range(40)), np.zeros((40, 5))))
    assert (whole.area, whole.interval.high, nothing.area, nothing.interval.low) == (1.0, 1.0, 0.0, 0.0)
    assert 0.9 < whole.interval.low < 1.0
    assert nothing.interval.high == pytest.approx(1.0 - whole.interval.low, abs=1e-6)


def test_a_seed_without_all_levels_is_left_out() -> None:
    whole = drawn(2)
    success = whole.success.copy()
    success[3, 2] = np.nan
    found = area(Curve(HERE, LEVELS, whole.seeds, success))
    rest = np.delete(whole.success, 3, axis=0)
    assert (found.seeds, found.area) == (29, pytest.approx(np.mean(rest[:, 1:] @ weights(LEVELS[1:]))))
    lonely = area(Curve(HERE, LEVELS, (0,), np.full((1, 5), np.nan)))
    assert (lonely.seeds, lonely.area, lonely.interval) == (0, None, (0.0, 1.0))
    assert areas([Curve(HERE, LEVELS[:2], whole.seeds, whole.success[:, :2])]) == ()


def test_what_both_seeds_share_cancels() -> None:
    ours = drawn(3, "contact", 0.0, 200)
    theirs = drawn(3, "paper", 0.2, 200)
    found = {(d.setting.method, d.reference): d for d in area_differences([ours, theirs, drawn(3, "none", 9.0, 200)])}
    assert set(found) == {("contact", "paper"), ("contact", "none"), ("paper", "none"), ("none", "paper")}
    pair = found["contact", "paper"]
    assert pair.difference == pytest.approx((area(ours).area or 0) - (area(theirs).area or 0))
    assert pair.interval.low > 0.0
    alone = [area(c).interval for c in (ours, theirs)]
    assert pair.interval.high - pair.interval.low < 0.7 * min(i.high - i.low for i in alone)


def test_none_is_the_reference_of_methods_that_were_told_otherwise() -> None:
    told = drawn(4, "contact")
    false = Curve(told.setting._replace(relations="false"), LEVELS, told.seeds, told.success)
    found = area_differences([drawn(4, "none"), false])
    assert [(d.setting.relations, d.reference, d.difference) for d in found] == [("false", "none", 0.0)]


def test_only_levels_that_both_have_are_compared() -> None:
    ours = drawn(5)
    theirs = drawn(5, "paper")
    fewer = Curve(theirs.setting, LEVELS[[0, 1, 3]], theirs.seeds, theirs.success[:, [0, 1, 3]])
    assert {d.levels for d in area_differences([ours, fewer])} == {(0.1, 1.0)}
    one = Curve(theirs.setting, LEVELS[[1]], theirs.seeds, theirs.success[:, [1]])
    assert area_differences([ours, one]) == ()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), shift=st.sampled_from([0.0, 0.1, 1.0]))
def test_a_difference_turns_round_with_its_methods(seed: int, shift: float) -> None:
    both = [drawn(seed, "contact"), drawn(seed, "paper", shift)]
    (a,) = area_differences(both, ("paper",))
    (b,) = area_differences(both, ("contact",))
    assert (a.seeds, a.difference) == (b.seeds, pytest.approx(-(b.difference or 0.0), abs=1e-12))
    assert a.interval == pytest.approx((-b.interval.high, -b.interval.low), abs=1e-6)
    assert a.interval.low <= (a.difference or 0.0) + 1e-9
    assert (a.difference or 0.0) <= a.interval.high + 1e-9


def test_seeds_not_seen_differ_by_one_level_at_least_and_no_more_than_those_that_were() -> None:
    w = weights(LEVELS[1:])
    assert reach(np.zeros((2, 5)), LEVELS[1:]).tolist() == [w.max(), w.max()]
    assert float(reach(np.array([0.0, -0.9, 0.1]), LEVELS[1:])) == 0.9
    nothing = area_differences([drawn(6), drawn(6, "paper")], ("paper",))[0]
    assert nothing.interval == mean_interval(np.zeros(30), -w.max(), w.max())


def test_settings_keep_their_order() -> None:
    assert [a.setting for a in areas([drawn(1, m) for m in ("none", "contact")])] == [
        CurveSetting(*HERE[:5], "none"),
        CurveSetting(*HERE[:5], "contact"),
    ]
