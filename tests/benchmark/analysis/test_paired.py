"""Paired comparison: the interval against published and exact values, the pairs against what rows say."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multinomial, ttest_rel
from statsmodels.stats.contingency_tables import mcnemar as reference
from statsmodels.stats.multitest import multipletests

from apo_bench.benchmark.analysis import compute_tango_interval, compute_wilson_interval
from apo_bench.benchmark.analysis.paired import holm, mcnemar, paired
from apo_bench.benchmark.report.report import report
from tests import pages
from tests.benchmark.analysis.test_rates import row, write

Z2 = 1.959963984540054**2


def test_tango_published_example() -> None:
    """Airway hyper-responsiveness before and after stem cell transplantation (Bentur et al. 2009), 1 and 7 of 21
    pairs discordant, as in Fagerland, Lydersen and Laake, Statistics in Medicine 33 (2014)."""
    assert compute_tango_interval(1, 7, 21) == pytest.approx((-0.517, -0.026), abs=5e-4)


@pytest.mark.parametrize("n", [1, 10, 100, 125, 1000])
def test_without_a_discordant_pair_the_interval_is_symmetric_and_not_empty(n: int) -> None:
    assert compute_tango_interval(0, 0, n) == pytest.approx((-Z2 / (n + Z2), Z2 / (n + Z2)), rel=1e-6)


@settings(max_examples=100, deadline=None)
@given(n=st.integers(1, 500), data=st.data())
def test_tango_is_ordered_and_turns_round_with_its_methods(n: int, data: st.DataObject) -> None:
    b = data.draw(st.integers(0, n))
    c = data.draw(st.integers(0, n - b))
    low, high = compute_tango_interval(b, c, n)
    assert -1.0 <= low <= (b - c) / n <= high <= 1.0
    assert compute_tango_interval(c, b, n) == pytest.approx((-high, -low), abs=1e-9)


@pytest.mark.parametrize(("p", "q"), [(0.02, 0.02), (0.1, 0.02), (0.3, 0.1), (0.6, 0.05)])
def test_tango_covers_in_95_of_100(p: float, q: float) -> None:
    """Exactly, over every table of 60 pairs: near the nominal 95 %, conservative where pairs are rarely discordant."""
    n = 60
    covered = 0.0
    for b in range(n + 1):
        for c in range(n + 1 - b):
            weight = multinomial.pmf([b, c, n - b - c], n, [p, q, 1 - p - q])
            if weight > 1e-6:
                low, high = compute_tango_interval(b, c, n)
                covered += weight * (low <= p - q <= high)
    assert 0.93 <= covered <= (0.97 if p + q > 0.1 else 1.0)


@pytest.mark.parametrize(
    ("only_first", "only_second", "expected"),
    [
        (12, 2, 0.0129),  # two media for tubercle bacilli: Armitage and Berry, Statistical Methods, 1994, p. 127
        (1, 7, 0.0703),  # airway hyper-responsiveness: Fagerland, Lydersen and Laake, BMC Med. Res. Meth. 13:91 (2013)
        (6, 16, 0.0525),  # complete response of leukaemia: the same
    ],
)
def test_mcnemar_published_examples(only_first: int, only_second: int, expected: float) -> None:
    assert mcnemar(only_first, only_second) == pytest.approx(expected, abs=5e-5)


@settings(max_examples=50, deadline=None)
@given(b=st.integers(0, 200), c=st.integers(0, 200))
def test_mcnemar_is_the_two_sided_sign_test(b: int, c: int) -> None:
    p = mcnemar(b, c)
    assert p == mcnemar(c, b)
    assert p == pytest.approx(reference([[0, b], [c, 0]], exact=True).pvalue, rel=1e-9)
    if b >= c > 0:
        assert mcnemar(b + 1, c - 1) <= p


def test_holm_worked_example() -> None:
    """By hand: 4 x 0.005, 3 x 0.01, 2 x 0.03, and 0.04, which may not be below the one before; as statsmodels."""
    p = list(np.random.default_rng(1).random(20))
    assert list(holm(dict(enumerate(p))).values()) == pytest.approx(multipletests(p, method="holm")[1])
    found = holm({"a": 0.01, "b": 0.04, "c": 0.03, "d": 0.005})
    assert found == pytest.approx({"a": 0.03, "b": 0.06, "c": 0.06, "d": 0.02})


def test_a_comparison_and_its_mirror_image_are_adjusted_as_one() -> None:
    """`none` against `paper` and `paper` against `none` are one of three comparisons, not two of four."""
    found = {(p.condition.method, p.reference): p for p in paired(rows())}
    assert found["uncorrected", "paper"].p == found["paper", "uncorrected"].p == mcnemar(7, 0)
    assert found["uncorrected", "paper"].p_adjusted == found["paper", "uncorrected"].p_adjusted
    raised = holm({0: mcnemar(2, 1), 1: mcnemar(8, 0), 2: mcnemar(7, 0)})
    assert [
        found[k].p_adjusted for k in (("contact", "paper"), ("contact", "uncorrected"), ("paper", "uncorrected"))
    ] == [*raised.values()]


def test_what_is_mended_and_what_is_spoilt() -> None:
    """The raw replay is right at seeds 0 to 3 of 10, the corrected one at 2 to 7: two spoilt of 4, four mended of 6."""
    given = [row("uncorrected", i, i < 4) for i in range(10)] + [row("contact", i, 2 <= i < 8) for i in range(10)]
    (pair,) = [p for p in paired(given) if (p.condition.method, p.reference) == ("contact", "uncorrected")]
    assert (pair.both, pair.neither, pair.pairs) == (2, 2, 10)
    assert (pair.recovered, pair.harmed) == ((4, 6), (2, 4))
    assert (pair.recovered.rate, pair.harmed.interval) == (4 / 6, compute_wilson_interval(2, 4))


@settings(max_examples=15, deadline=None)
@given(results=st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=30), order=st.randoms())
def test_pairs_add_up_in_any_order(results: list[tuple[bool, bool]], order: Any) -> None:
    given = [row(m, i, r[k]) for i, r in enumerate(results) for k, m in enumerate(("contact", "uncorrected"))]
    shuffled = list(given)
    order.shuffle(shuffled)
    (pair,) = paired(given, ("uncorrected",))
    assert (pair,) == paired(shuffled, ("uncorrected",))
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
    found = {(p.condition.method, p.reference): p for p in paired([*rows(), row("oracle")])}
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
    pair = paired(rows())[0]
    errors = {m: [r["planned_error_free_mm"] for r in rows() if r["method"] == m] for m in ("contact", "uncorrected")}
    (pair,) = [p for p in paired(rows()) if (p.condition.method, p.reference) == ("contact", "uncorrected")]
    expected = ttest_rel(errors["contact"], errors["uncorrected"]).confidence_interval(0.95)
    assert pair.free_mm == pytest.approx(np.mean(errors["contact"]) - np.mean(errors["uncorrected"]))
    assert pair.free_interval == pytest.approx((expected.low, expected.high))


def test_only_seeds_that_both_have_are_pairs() -> None:
    given = [row("contact", 0), row("contact", 1, None), row("contact", 2), row("paper", 1), row("paper", 2, False)]
    (pair,) = paired(given)
    assert (pair.pairs, pair.only_method, pair.only_reference, pair.planned) == (1, 1, 0, 0)
    assert (pair.free_mm, pair.free_interval) == (None, None)


def test_none_is_the_reference_whatever_relations_were_told() -> None:
    """The paper's way with the same wrong relations, `none` with the right ones, which it does not ask for."""
    given = [
        row("uncorrected", success=False),
        row("paper", contact_source="false-positive"),
        row("contact", contact_source="false-positive"),
    ]
    found = paired([*given, row("paper"), row("contact", 0, False)])
    assert [(p.condition.contact_source, p.condition.method, p.reference, p.difference) for p in found] == [
        ("given", "uncorrected", "paper", -1.0),
        ("given", "contact", "paper", -1.0),
        ("given", "contact", "uncorrected", 0.0),
        ("given", "paper", "uncorrected", 1.0),
        ("false-positive", "contact", "paper", 0.0),
        ("false-positive", "contact", "uncorrected", 1.0),
        ("false-positive", "paper", "uncorrected", 1.0),
    ]


def test_the_report_holds_the_pairs(tmp_path: Path) -> None:
    made = report(write(tmp_path / "run", rows()))
    table = list(csv.DictReader(made.tables["pairs"].open()))
    assert len(table) == len(paired(rows()))
    assert "| contact | 1 | paper | 10 | 6, 2, 1, 1 | +10.0 (" in pages.lines(made.page)
