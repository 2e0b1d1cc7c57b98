"""The sentence at the top of a report."""

from __future__ import annotations

from typing import Any

import pytest

from apo_bench.report.answer import answer
from apo_bench.statistics.paired import tango
from apo_bench.statistics.rates import wilson
from apo_bench.statistics.summary import summary
from tests.statistics.test_rates import row


def said(rows: list[dict[str, Any]]) -> str:
    return answer(rows, summary(rows))


def test_one_trial_a_seed_has_the_intervals_of_the_tables() -> None:
    rows = [row("contact", i, i > 0) for i in range(20)] + [row("none", i, i > 11) for i in range(20)]
    (low, high), (least, most) = wilson(19, 20), tango(11, 0, 20)
    assert said(rows) == (
        f"`contact` succeeds in 95.0 % of its 20 trials (95 %: {100 * low:.1f} to {100 * high:.1f} %); at the same "
        f"seeds it succeeds more often than `none` by 55.0 points (95 %: {100 * least:.1f} to {100 * most:.1f})."
    )


def test_it_says_up_to_which_noise_and_that_seeds_do_not_tell_methods_apart() -> None:
    levels = ({"level": x, "level_deg": x} for x in (0.5, 1.0, 2.0, 4.0))
    rows = [row(m, i, x["level"] < 2.0, **x) for x in levels for m in ("contact", "paper") for i in range(30)]
    (half, _) = summary(rows).half_levels
    words = said(rows)
    assert f"and in half of them or more up to level {half.text} (95 %: {half.interval_text})" in words
    assert "as often as `paper`, as far as 30 seeds tell (+0.0 points" in words


@pytest.mark.parametrize(
    ("h", "words"), [(9.0, "even at level 4, the largest tried"), (0.0, "only below level 1, the smallest tried")]
)
def test_levels_that_do_not_reach_one_half_say_so(h: float, words: str) -> None:
    assert words in said([row("contact", i, x < h, level=x, level_deg=x) for x in (1.0, 4.0) for i in range(9)])


def test_wrong_relations_do_not_count_where_right_ones_were_told() -> None:
    rows = [row("contact", i) for i in range(5)] + [row("contact", i, False, relations="missed") for i in range(5)]
    assert said(rows).startswith("`contact` succeeds in 100.0 % of its 5 trials")
    assert said(rows[5:]).startswith("`contact` succeeds in 0.0 % of its 5 trials")


@pytest.mark.parametrize("rows", [[row("oracle", i) for i in range(3)], [row("contact", i, None) for i in range(3)]])
def test_where_nothing_counts_it_says_so(rows: list[dict[str, Any]]) -> None:
    assert said(rows).startswith("No trial counts here")
