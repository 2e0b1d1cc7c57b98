"""Paired comparison: the interval against published and exact values, the pairs against what rows say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_rel
from statsmodels.stats.contingency_tables import mcnemar as reference
from statsmodels.stats.multitest import multipletests

from apo_bench.benchmark.analysis import compute_tango_interval
from apo_bench.benchmark.analysis.paired import adjust_by_holm, compare_pairs, compute_mcnemar_p_value
from tests.benchmark.analysis.test_rates import row


def test_tango_published_example() -> None:
    """Airway hyper-responsiveness before and after stem cell transplantation (Bentur et al. 2009), 1 and 7 of 21
    pairs discordant, as in Fagerland, Lydersen and Laake, Statistics in Medicine 33 (2014)."""
    assert compute_tango_interval(1, 7, 21) == pytest.approx((-0.517, -0.026), abs=5e-4)


@settings(max_examples=100, deadline=None)
@given(n=st.integers(1, 500), data=st.data())
def test_tango_is_ordered_and_turns_round_with_its_methods(n: int, data: st.DataObject) -> None:
    b = data.draw(st.integers(0, n))
    c = data.draw(st.integers(0, n - b))
    low, high = compute_tango_interval(b, c, n)
    assert -1.0 <= low <= (b - c) / n <= high <= 1.0
    assert compute_tango_interval(c, b, n) == pytest.approx((-high, -low), abs=1e-9)


@settings(max_examples=50, deadline=None)
@given(b=st.integers(0, 200), c=st.integers(0, 200))
def test_mcnemar_is_the_two_sided_sign_test(b: int, c: int) -> None:
    p = compute_mcnemar_p_value(b, c)
    assert p == compute_mcnemar_p_value(c, b)
    assert p == pytest.approx(reference([[0, b], [c, 0]], exact=True).pvalue, rel=1e-9)
    if b >= c > 0:
        assert compute_mcnemar_p_value(b + 1, c - 1) <= p


def test_holm_worked_example() -> None:
    """By hand: 4 x 0.005, 3 x 0.01, 2 x 0.03, and 0.04, which may not be below the one before; as statsmodels."""
    p = list(np.random.default_rng(1).random(20))
    assert list(adjust_by_holm(dict(enumerate(p))).values()) == pytest.approx(multipletests(p, method="holm")[1])
    found = adjust_by_holm({"a": 0.01, "b": 0.04, "c": 0.03, "d": 0.005})
    assert found == pytest.approx({"a": 0.03, "b": 0.06, "c": 0.06, "d": 0.02})


def test_a_comparison_and_its_mirror_image_are_adjusted_as_one() -> None:
    """`none` against `paper` and `paper` against `none` are one of three comparisons, not two of four."""
    found = {(p.condition.method, p.reference): p for p in compare_pairs(rows())}
    assert found["uncorrected", "paper"].p == found["paper", "uncorrected"].p == compute_mcnemar_p_value(7, 0)
    assert found["uncorrected", "paper"].p_adjusted == found["paper", "uncorrected"].p_adjusted
    raised = adjust_by_holm(
        {0: compute_mcnemar_p_value(2, 1), 1: compute_mcnemar_p_value(8, 0), 2: compute_mcnemar_p_value(7, 0)}
    )
    assert [
        found[k].p_adjusted for k in (("contact", "paper"), ("contact", "uncorrected"), ("paper", "uncorrected"))
    ] == [*raised.values()]


@settings(max_examples=15, deadline=None)
@given(results=st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=30), order=st.randoms())
def test_pairs_add_up_in_any_order(results: list[tuple[bool, bool]], order: Any) -> None:
    given = [row(m, i, r[k]) for i, r in enumerate(results) for k, m in enumerate(("contact", "uncorrected"))]
    shuffled = list(given)
    order.shuffle(shuffled)
    (pair,) = compare_pairs(given, ("uncorrected",))
    assert (pair,) == compare_pairs(shuffled, ("uncorrected",))
    assert pair.recovered.trials + pair.harmed.trials == pair.pairs == len(results)
    assert pair.both + pair.neither + pair.only_method + pair.only_reference == pair.pairs


def rows() -> list[dict[str, Any]]:
    """Ten seeds: the method right at 8, the paper at 6 of them and at one of its own, `none` at none."""
    right = {"contact": set(range(8)), "paper": {0, 1, 2, 3, 4, 5, 9}, "uncorrected": set()}
    errors = {"contact": 1.0, "paper": 1.5, "uncorrected": 2.0}
    noise = np.random.default_rng(3).normal(0, 0.1, (10, 3))
    return [
        row(m, seed, seed in right[m], planned_error_fixed_mm=0.1, planned_error_free_mm=errors[m] + noise[seed, i])
        for i, m in enumerate(right)
        for seed in range(10)
    ]


def test_discordant_pairs_are_counted_both_ways() -> None:
    found = {(p.condition.method, p.reference): p for p in compare_pairs([*rows(), row("oracle")])}
    assert set(found) == {
        ("contact", "paper"),
        ("contact", "uncorrected"),
        ("paper", "uncorrected"),
        ("uncorrected", "paper"),
    }
    pair = found["contact", "paper"]
    assert (pair.pairs, pair.only_method, pair.only_reference, pair.difference) == (10, 2, 1, 0.1)
    assert pair.interval == compute_tango_interval(2, 1, 10)
    back = found["uncorrected", "paper"]
    assert (back.only_method, back.only_reference, back.difference) == (0, 7, -0.7)


def test_free_errors_are_compared_pair_by_pair() -> None:
    pair = compare_pairs(rows())[0]
    errors = {m: [r["planned_error_free_mm"] for r in rows() if r["method"] == m] for m in ("contact", "uncorrected")}
    (pair,) = [p for p in compare_pairs(rows()) if (p.condition.method, p.reference) == ("contact", "uncorrected")]
    expected = ttest_rel(errors["contact"], errors["uncorrected"]).confidence_interval(0.95)
    assert pair.free_mm == pytest.approx(np.mean(errors["contact"]) - np.mean(errors["uncorrected"]))
    assert pair.free_interval == pytest.approx((expected.low, expected.high))


def test_only_seeds_that_both_have_are_pairs() -> None:
    given = [row("contact", 0), row("contact", 1, None), row("contact", 2), row("paper", 1), row("paper", 2, False)]
    (pair,) = compare_pairs(given)
    assert (pair.pairs, pair.only_method, pair.only_reference, pair.planned) == (1, 1, 0, 0)
    assert (pair.free_mm, pair.free_interval) == (None, None)
