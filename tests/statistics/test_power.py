"""How many trials it takes: against tables, published examples and plain sums; the command and its refusals."""

from __future__ import annotations

import json
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, multinomial

from apo_bench import InputError
from apo_bench.cli.app import main
from apo_bench.statistics import (
    evidence,
    margin_power,
    margin_trials,
    paired_power,
    paired_trials,
    rate_trials,
    shares,
    tango,
    wilson,
    wilson_half_width,
)
from apo_bench.statistics.paired import mcnemar


@pytest.mark.parametrize(
    ("rate", "half_width", "trials"), [(0.9, 0.05, 141), (0.9, 0.03, 388), (0.5, 0.05, 381), (0.5, 0.03, 1064)]
)
def test_trials_for_a_rate(rate: float, half_width: float, trials: int) -> None:
    assert rate_trials(rate, half_width) == trials
    assert wilson_half_width(rate, trials) <= half_width < wilson_half_width(rate, trials - 1)


@pytest.mark.parametrize(("successes", "trials"), [(9, 10), (50, 100), (0, 7), (141, 141)])
def test_the_half_width_is_that_of_wilsons_interval(successes: int, trials: int) -> None:
    low, high = wilson(successes, trials)
    assert wilson_half_width(successes / trials, trials) == pytest.approx((high - low) / 2, abs=1e-9)


def test_published_power_of_the_exact_test() -> None:
    """R. G. O'Brien's example in the manual of G*Power 3.1: 40 % discordant, odds 1 to 4, 50 pairs, one-sided 0.05; the
    size of that test is 0.0326, its power 0.839."""
    assert paired_power(50, 0.08, 0.32, 0.10) == pytest.approx(0.839, abs=5e-4)
    assert paired_power(50, 0.2, 0.2, 0.10) == pytest.approx(0.032578, abs=1e-5)


@pytest.mark.parametrize(("pairs", "win", "lose"), [(12, 0.5, 0.1), (25, 0.3, 0.3), (30, 0.0, 0.4), (9, 0.0, 0.0)])
def test_power_is_the_sum_over_every_table(pairs: int, win: float, lose: float) -> None:
    better = max(win, lose)
    worse = min(win, lose)
    expected = sum(
        multinomial.pmf([b, c, pairs - b - c], pairs, [better, worse, 1 - better - worse])
        for b, c in product(range(pairs + 1), repeat=2)
        if b + c <= pairs and b > c and mcnemar(b, c) <= 0.05
    )
    assert paired_power(pairs, win, lose) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("win", "lose", "comparisons"), [(0.1, 0.02, 1), (0.06, 0.0, 1), (0.2, 0.1, 10)])
def test_pairs_for_a_difference(win: float, lose: float, comparisons: int) -> None:
    n = paired_trials(win, lose, comparisons=comparisons)
    assert n == paired_trials(lose, win, comparisons=comparisons)
    assert paired_power(n - 1, win, lose, 0.05 / comparisons) < 0.8 <= paired_power(n, win, lose, 0.05 / comparisons)


def test_without_a_discordant_pair_125_show_three_points() -> None:
    assert (margin_trials(0.03), margin_trials(0.05)) == (125, 73)
    assert tango(0, 0, 125).low > -0.03 > tango(0, 0, 124).low
    assert (margin_power(125, 0.03), margin_power(124, 0.03)) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("pairs", "margin", "win", "lose"), [(30, 0.1, 0.05, 0.05), (40, 0.2, 0.3, 0.3), (8, 0.4, 1, 0)]
)
def test_power_for_a_margin_is_the_sum_over_every_table(pairs: int, margin: float, win: float, lose: float) -> None:
    expected = sum(
        multinomial.pmf([b, c, pairs - b - c], pairs, [win, lose, 1 - win - lose])
        for b, c in product(range(pairs + 1), repeat=2)
        if b + c <= pairs and tango(b, c, pairs).low > -margin
    )
    assert margin_power(pairs, margin, win, lose) == pytest.approx(expected, abs=1e-6)


def test_what_a_hundred_show() -> None:
    found = evidence(100)
    assert (found.discordant, found.all_right) == (6, wilson(100, 100))
    assert mcnemar(6, 0) <= 0.05 < mcnemar(5, 0)
    assert found.margin == pytest.approx(-tango(0, 0, 100).low, abs=1e-6)
    assert found.least_win is not None
    assert paired_power(100, found.least_win, 0.0) == pytest.approx(0.8, abs=1e-6)
    strict = evidence(100, comparisons=32)
    assert strict.discordant is not None
    assert mcnemar(strict.discordant, 0) <= 0.05 / 32 < mcnemar(strict.discordant - 1, 0)
    assert (evidence(5).discordant, evidence(5).least_win) == (None, None)


@settings(max_examples=50, deadline=None)
@given(rate=st.floats(0.0, 1.0), reference=st.floats(0.0, 1.0), part=st.floats(0.0, 1.0))
def test_shares_give_the_rates_back(rate: float, reference: float, part: float) -> None:
    least = abs(1 - rate - reference)
    most = 1 - abs(rate - reference)
    agree = least + part * (most - least)
    for win, lose in (shares(rate, reference, agree), shares(rate, reference)):
        assert win - lose == pytest.approx(rate - reference, abs=1e-9)
        assert min(win, lose) >= 0.0
        assert win + lose <= 1.0 + 1e-9
    assert sum(shares(rate, reference, agree)) == pytest.approx(1 - agree, abs=1e-9)


@pytest.mark.parametrize("n", [10, 1000])
def test_counts_left_out_of_the_sums_do_not_matter(n: int) -> None:
    from apo_bench.statistics.power import _likely

    for p in (0.0, 0.001, 0.3, 1.0):
        assert binom.pmf(_likely(n, p), n, p).sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("rate --rate 0.9 --half-width 0.05", "141 trials"),
        ("pairs --win 0.1 --lose 0.02", "153 seeds"),
        ("pairs --rates 0.95,0.85 --agree 0.86 --comparisons 32", "the first of 32 by Holm"),
        ("margin --margin 0.03", "125 seeds"),
        ("shows --trials 100", "from 6 discordant pairs on"),
        ("shows --trials 5", "can show no difference with so few: it takes 6 or more"),
        ("", "apo-bench power shows"),
    ],
)
def test_the_command_says_it_in_words(given: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["power", *given.split()]) == 0
    assert said in capsys.readouterr().out


@pytest.mark.parametrize("given", ["rate --half-width 0.1", "pairs --win 0.3 --lose 0", "margin --margin 0.1"])
def test_and_as_json(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["power", *given.split(), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["schema"], found["question"]) == ("apo-bench/power/1", given.split()[0])
    assert found["trials"] == {"rate": 93, "pairs": 25, "margin": 35}[found["question"]]


@pytest.mark.parametrize(
    "given",
    [
        "rate --half-width 5", "rate --half-width nan", "rate", "rate --half-width 0.05 --rate 90",
        "rate --half-width 1e-9", "pairs", "pairs --win 0.1", "pairs --win 0.1 --lose 0.1",
        "pairs --win 0.9 --lose 0.3", "pairs --rates a,b", "pairs --rates 0.5", "pairs --rates 0.5,0.9 --agree 0.95",
        "pairs --win nan --lose 0", "pairs --win 0.1 --lose 0 --power 1", "pairs --win 0.1 --lose 0 --comparisons 0",
        "margin --margin 0", "margin --margin 0.03 --win 0 --lose 0.05", "shows --trials 0", "shows --trials x",
        "shows",
    ],
)  # fmt: skip
def test_a_wrong_request_gets_one_sentence(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["power", *given.split()]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith("apo-bench: ")


def test_in_python_too() -> None:
    with pytest.raises(InputError, match=r"0\.9 stands for 90 %"):
        rate_trials(90, 0.05)
