"""What a sweep answers, in one sentence: who succeeds, up to which noise, who is better by how much, and how sure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from apo_bench.records.method import knows_relations, knows_truth
from apo_bench.records.row import Row, look_up
from apo_bench.statistics.levels.bounded import mean_interval
from apo_bench.statistics.levels.half_level import HalfLevel
from apo_bench.statistics.paired import tango
from apo_bench.statistics.rate_text import percent
from apo_bench.statistics.rates import Interval, Place, rank, wilson
from apo_bench.statistics.summary import Summary

_AGAINST = ("none", "paper", "contact")
"""The best method is compared with these; if none of them was tried, with the next best."""
_Who = tuple[str, int]
"""A method, and how often it might look again."""
_Results = Mapping[tuple[Any, ...], bool]
"""All that a trial is of but the method, its seed last -> success."""


def answer(rows: Iterable[Row], found: Summary) -> str:
    """The sentence, with methods in backquotes. Trials that were told wrong relations are left out where others are."""
    results = _results(rows)
    if not results:
        return "No trial counts here: either no demonstration was right itself, or only the oracle was tried."
    best, *others = _ranked(results)
    count, (low, high) = len(results[best]), _rate_interval(results[best])
    said = f"{_named(best)} succeeds in {percent(sum(results[best].values()) / count)} of its {count:,} trials "
    said += f"(95 %: {100 * low:.1f} to {100 * high:.1f} %)"
    curves = [h for h in found.half_levels if h.setting.relations == "given"]
    half = [h for h in curves if (h.setting.method, h.setting.looks) == best]
    said += f" and in half of them or more {_reach(half)}" if half else ""
    known = [(m, 0) for m in _AGAINST if (m, 0) in results and (m, 0) != best] or others[:1]
    compared = [words for words in (_compared(best, m, results) for m in known) if words]
    return f"{said}; at the same seeds it succeeds {' and '.join(compared)}." if compared else f"{said}."


def _named(who: _Who) -> str:
    """`contact`, or `contact-robust` with 2 more looks."""
    method, looks = who
    return f"`{method}`" + (f" with {looks} more look{'s' * (looks > 1)}" if looks else "")


def _results(rows: Iterable[Row]) -> dict[_Who, dict[tuple[Any, ...], bool]]:
    names = [name for name in Place._fields if name not in ("method", "relations", "fidelity", "looks")]
    right: dict[_Who, dict[tuple[Any, ...], bool]] = {}
    wrong: dict[_Who, dict[tuple[Any, ...], bool]] = {}
    for row in rows:
        if row["success"] is not None and row["level"] is not None and not knows_truth(row["method"]):
            told = row["relations"] if knows_relations(row["method"]) else "given"
            kept = right if told == "given" else wrong
            key = (*(look_up(row, name) for name in names), row.get("fidelity"), told, row["seed"])
            kept.setdefault((row["method"], row.get("looks") or 0), {})[key] = row["success"]
    return right or wrong


def _ranked(results: Mapping[_Who, _Results]) -> list[_Who]:
    """The best first, by trials that all have that were tried in half of all places or more."""
    most = max(map(len, results.values()))
    widely = [who for who in results if 2 * len(results[who]) >= most]
    common = set.intersection(*(set(results[who]) for who in widely))

    def rate(who: _Who) -> float:
        own = [results[who][key] for key in common] or list(results[who].values())
        return sum(own) / len(own)

    return sorted(widely, key=lambda who: (-rate(who), rank(who[0]), who))


def _compared(ours: _Who, other: _Who, results: Mapping[_Who, _Results]) -> str:
    """`more often than `none` by 41.2 points (95 %: 38.9 to 43.4)`; nothing where they have no trial in common."""
    a, b = results[ours], results[other]
    both = {key: float(a[key]) - float(b[key]) for key in a if key in b}
    if not both:
        return ""
    apart = _by_seed(both)
    low, high = (100 * x for x in _difference_interval(both))
    mean = 100 * float(np.mean(apart))
    if low > 0 or high < 0:
        more = "more" if mean > 0 else "less"
        low, high = sorted((abs(low), abs(high)))
        return f"{more} often than {_named(other)} by {abs(mean):.1f} points (95 %: {low:.1f} to {high:.1f})"
    between = f"{mean:+.1f} points, 95 %: {low:+.1f} to {high:+.1f}"
    return f"as often as {_named(other)}, as far as {len(apart)} seeds tell ({between})"


def _by_seed(results: Mapping[tuple[Any, ...], float]) -> list[float]:
    """Means over all trials of a seed: they share their random numbers, so that seeds are independent."""
    seeds: dict[int, list[float]] = {}
    for key, value in results.items():
        seeds.setdefault(key[-1], []).append(float(value))
    return [float(np.round(np.mean(sorted(seeds[seed])), 12)) for seed in sorted(seeds)]


def _rate_interval(results: _Results) -> Interval:
    """Wilson's where every seed has one trial, as in the tables; else of the means over seeds."""
    by_seed = _by_seed(results)
    if len(by_seed) == len(results):
        return wilson(sum(results.values()), len(results))
    return mean_interval(np.array(by_seed))


def _difference_interval(both: Mapping[tuple[Any, ...], float]) -> Interval:
    """Tango's where every seed has one pair; else of the means over seeds.

    A seed that was not seen may differ as much as any that was, and at least as much as one of its trials makes.
    """
    by_seed = _by_seed(both)
    if len(by_seed) == len(both):
        values = list(both.values())
        return tango(values.count(1.0), values.count(-1.0), len(values))
    most = max([len(by_seed) / len(both), *map(abs, by_seed)])
    return mean_interval(np.array(by_seed), -most, most)


def _reach(half: Sequence[HalfLevel]) -> str:
    """`up to level 1.31 (95 %: 1.1 to 1.6)`, or from the worst of several settings to the best."""
    ends = sorted(half, key=lambda h: (h.beyond == "above", h.level or 0.0, h.largest))
    worst, best = (_half(ends[i]) for i in (0, -1))
    if len(ends) == 1:
        return worst if ends[0].level is None else f"{worst} (95 %: {ends[0].interval_text})"
    if worst == best:
        return f"{worst}, in each of {len(ends)} settings"
    return f"{worst} in the worst of {len(ends)} settings and {best} in the best"


def _half(h: HalfLevel) -> str:
    if h.level is not None:
        return f"up to level {h.text}"
    if h.beyond == "above":
        return f"even at level {h.largest:g}, the largest tried"
    return f"only below level {h.smallest:g}, the smallest tried" if h.beyond == "below" else "at no level"
