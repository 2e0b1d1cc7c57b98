"""The sentences at the top of a report: they count first, and never say more than the counts."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.benchmark.analysis import (
    FEWEST_SEEDS,
    Results,
    compute_tango_interval,
    compute_wilson_interval,
    contrast,
    summarise,
)
from apo_bench.benchmark.report.conclusions import ALIKE_WITHIN, write_answer
from tests.benchmark.analysis.test_rates import row

METHODS = ("contact", "uncorrected", "paper", "snap")
COUNT = re.compile(r"`([^`]+)`(?: with \d reobservations)? (?:succeeds )?in ([\d,]+) of (?:the same )?([\d,]+)")


def said(rows: list[dict[str, Any]]) -> str:
    return write_answer(rows, summarise(rows).half_levels)


def at_levels(method: str, seed: int, successes: tuple[bool, ...]) -> list[dict[str, Any]]:
    return [row(method, seed, success, noise_mm=x, noise_deg=x) for x, success in enumerate(successes, start=1)]


def test_one_trial_a_seed_has_the_intervals_of_the_tables() -> None:
    rows = [row("contact", i, i > 0) for i in range(20)] + [row("uncorrected", i, i > 11) for i in range(20)]
    low, high = compute_wilson_interval(19, 20)
    least, most = compute_tango_interval(11, 0, 20)
    assert said(rows) == (
        f"`contact` succeeds in 19 of 20 trials (95.0 %; 95 % interval {100 * low:.1f} to {100 * high:.1f} %). "
        "`uncorrected` succeeds in 8 of the same 20: `contact` succeeds more often, by 55.0 points (95 % interval "
        f"{100 * least:+.1f} to {100 * most:+.1f})."
    )


def test_all_against_nothing_with_few_seeds_is_counted_and_nothing_more() -> None:
    """The first sweep of a new user: 24 of 24 against 0 of 24 is not `as often`, and 4 seeds have no interval."""
    rows = [r for i in range(4) for r in at_levels("contact", i, (True,) * 6)]
    rows += [r for i in range(4) for r in at_levels("uncorrected", i, (False,) * 6)]
    assert said(rows) == (
        "`contact` succeeds in 24 of 24 trials (100.0 %). `uncorrected` succeeds in 0 of the same 24. 4 seeds are too "
        "few for an interval: from 6 on, a difference at every seed is beyond chance."
    )


def test_equal_counts_are_as_often_only_where_the_interval_is_narrow() -> None:
    for seeds, words in ((30, "as many, but 30 seeds leave room for a difference"), (200, "as often, to within 1.9")):
        rows = [row(m, i) for m in ("contact", "uncorrected") for i in range(seeds)]
        assert f"`contact` succeeds in {seeds} of the same {seeds}: {words}" in said(rows)


def test_wrong_relations_do_not_count_where_right_ones_were_told() -> None:
    rows = [row("contact", i) for i in range(5)] + [
        row("contact", i, False, contact_source="false-negative") for i in range(5)
    ]
    assert said(rows).startswith("`contact` succeeds in 5 of 5 trials")
    assert "in 0 of 5" in said(rows[5:])
    assert said(rows[5:]).endswith("Correctors used the contacts `false-negative` here, not `given`.")


def columns(results: dict[tuple[Any, ...], bool]) -> Results:
    """A number for each trial, from its level and its seed."""
    keys = [1000 * level + seed for level, seed in results]
    return Results(np.array(keys), np.array([seed for _, seed in results]), np.array([*results.values()], dtype=float))


@st.composite
def tables(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Some methods over some seeds and levels, at any rate; trials are missing, demonstrations excluded."""
    methods = draw(st.lists(st.sampled_from(METHODS), min_size=1, max_size=4, unique=True))
    seeds = draw(st.sampled_from((1, 2, 5, 6, 10, 40)))
    levels = draw(st.integers(1, 3))
    excluded = draw(st.sets(st.integers(0, seeds - 1), max_size=2))
    made = []
    for method in methods:
        rate = draw(st.sampled_from((0.0, 0.1, 0.5, 0.95, 1.0)))
        kept = draw(st.sampled_from((0.6, 1.0)))
        luck = draw(st.randoms(use_true_random=False))
        for seed in range(seeds):
            for level in range(1, levels + 1):
                success = None if seed in excluded else luck.random() < rate
                if luck.random() < kept:
                    made.append(row(method, seed, success, noise_mm=float(level), noise_deg=float(level)))
    return made


@settings(max_examples=60, deadline=None)
@given(rows=tables())
def test_no_sentence_contradicts_the_counts(rows: list[dict[str, Any]]) -> None:
    results: dict[str, dict[tuple[Any, ...], bool]] = {}
    for r in rows:
        if r["success"] is not None:
            results.setdefault(r["method"], {})[r["noise_mm"], r["seed"]] = r["success"]
    words = write_answer(rows, ())
    if not any(any(own.values()) for own in results.values()):
        assert words.startswith("No method succeeds in any trial" if results else "No trial counts")
        return
    sentences = re.split(r"(?<=\.) (?=[`A-Z0-9])", words)
    best, right, trials = COUNT.search(sentences[0]).groups()  # type: ignore[union-attr]
    assert (int(right), int(trials)) == (sum(results[best].values()), len(results[best]))
    seeds = len({seed for _, seed in results[best]})
    assert ("interval" in sentences[0]) == (seeds >= FEWEST_SEEDS)
    for other, own in results.items():
        about = [s for s in sentences[1:] if re.search(rf"`{other}` succeeds in", s)]
        if other == best or not about:
            continue
        (sentence,) = about
        shared = results[best].keys() & own.keys()
        ours, theirs = (sum(results[m][key] for key in shared) for m in (best, other))
        c = contrast(columns(results[best]), columns(own))
        assert c is not None
        assert re.search(rf"`{other}` succeeds in {theirs}\b", sentence)
        assert f" {len(shared)}" in sentence
        low, high = c.interval
        assert low - 1e-9 <= (ours - theirs) / len(shared) <= high + 1e-9
        if "more often" in sentence:
            assert ours > theirs
            assert low > 0
        if "less often" in sentence:
            assert ours < theirs
            assert high < 0
        if "as often" in sentence:
            assert -ALIKE_WITHIN <= low <= 0 <= high <= ALIKE_WITHIN
        if "ahead" in sentence or "behind" in sentence:
            assert ("ahead" in sentence) == (ours > theirs)
        if "as many, but" in sentence:
            assert ours == theirs
        if c.seeds < FEWEST_SEEDS:
            assert "interval" not in sentence
            assert "often" not in sentence
