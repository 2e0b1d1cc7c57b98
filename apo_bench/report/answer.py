"""What a sweep answers, in some sentences: what was counted first, then what the counts tell.

No sentence says more than its counts: an interval only where there are seeds enough for one, "more often" only where
the difference is beyond chance, "as often" only where the interval lies close around 0.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from apo_bench.io import listed_words
from apo_bench.records import CORRECTOR, Row, knows_relations, knows_truth, look_up
from apo_bench.statistics import (
    FEWEST_SEEDS,
    Contrast,
    Interval,
    Results,
    contrast,
    percent,
    percents,
    pooled_rate,
    rank,
)
from apo_bench.statistics.levels.half_level import HalfLevel, Summary
from apo_bench.statistics.rates import PLACE_FIELDS

ALIKE_WITHIN = 0.05
"""Two methods are alike only where the whole interval of their difference is within this, to either side of 0."""
_AGAINST = ("none", "paper", "contact", CORRECTOR)
"""The best method is compared with these; if none of them was tried, with the next best."""
_NAMED = 3
"""Of methods that are as good as the best so many are named."""
_GIVEN = "given"
_Who = tuple[str, int]
"""A method, and how often it might look again."""


def answer(rows: Iterable[Row], summary: Summary) -> str:
    """The sentences, with methods in backquotes; of trials with wrong relations only where there are no others."""
    rows = list(rows)
    results, kinds = _results(rows)
    if not results:
        return "No trial counts here: either no demonstration was right itself, or only the oracle was tried."
    best, *others = _ranked(results)
    own = pooled_rate(results[best])
    few = own.seeds < FEWEST_SEEDS
    if not any(any(each.values()) for each in results.values()):
        nothing = ", ".join(f"{_named(who)} in 0 of {len(results[who]):,}" for who in (best, *others))
        return f"No method succeeds in any trial: {nothing}.{_wrong(kinds)}"
    half = [
        h
        for h in summary.half_levels
        if h.setting.relations in kinds and (h.setting.method, h.setting.looks) == best and not few
    ]
    known = [(m, 0) for m in _AGAINST if (m, 0) in results and (m, 0) != best] or others[:1]
    counted = _counted(own.right, own.trials, None if few else own.interval)
    too_few = (
        f"{own.seeds} {'seed is' if own.seeds == 1 else 'seeds are'} too few for an interval: from {FEWEST_SEEDS} "
        "on, a difference at every seed is beyond chance."
    )
    sentences = (
        f"{_named(best)} succeeds in {counted}{_tied(best, others, results)}.",
        _reach(half) if half else "",
        *(_compared(best, m, results) for m in known),
        too_few * few,
    )
    return " ".join(sentence for sentence in sentences if sentence) + _wrong(kinds)


def _wrong(kinds: set[str]) -> str:
    """A sentence where nobody was told the right relations."""
    listed = ", ".join(f"`{kind}`" for kind in sorted(kinds))
    return "" if kinds == {_GIVEN} else f" Correctors were told relations {listed} here, not `{_GIVEN}`."


def _named(who: _Who) -> str:
    """`contact`, or `contact-robust` with 2 more looks."""
    method, looks = who
    return f"`{method}`" + (f" with {looks} more look{'s' * (looks > 1)}" if looks else "")


def _counted(right: int, trials: int, interval: Interval | None) -> str:
    """`95 of 100 trials (95.0 %; 95 % interval 88.8 to 97.8 %)`."""
    between = "" if interval is None else f"; 95 % interval {percents(interval)}"
    return f"{right:,} of {trials:,} trial{'s' * (trials != 1)} ({percent(right / trials)}{between})"


def _results(rows: Iterable[Row]) -> tuple[dict[_Who, dict[tuple[Any, ...], bool]], set[str]]:
    """Successes of each method, and what correctors were told: the right relations, or else what there is."""
    counted = [
        row
        for row in rows
        if row["success"] is not None and row["level"] is not None and not knows_truth(row["method"])
    ]
    kinds = {str(row["relations"]) for row in counted if knows_relations(row["method"])} or {_GIVEN}
    kinds = {_GIVEN} if _GIVEN in kinds else kinds
    names = [name for name in PLACE_FIELDS if name not in ("method", "relations", "fidelity", "looks")]
    results: dict[_Who, dict[tuple[Any, ...], bool]] = {}
    for row in counted:
        relations = str(row["relations"]) if knows_relations(row["method"]) else min(kinds)
        # the one trial of a method that is told nothing would count once for each kind of relations that others hear
        if relations in kinds and (len(kinds) == 1 or knows_relations(row["method"])):
            results.setdefault((row["method"], row.get("looks") or 0), {})[
                (*(look_up(row, name) for name in names), row.get("fidelity"), relations, row["seed"])
            ] = bool(row["success"])
    return results, kinds


def _ranked(results: Mapping[_Who, Results]) -> list[_Who]:
    """The best first, by trials that all have that were tried in half of all places or more."""
    most = max(map(len, results.values()))
    widely = [who for who in results if 2 * len(results[who]) >= most]
    common = set.intersection(*(set(results[who]) for who in widely))

    def rate(who: _Who) -> float:
        own = [results[who][key] for key in common] or list(results[who].values())
        return sum(own) / len(own)

    return sorted(widely, key=lambda who: (-rate(who), rank(who[0]), who))


def _tied(best: _Who, others: Sequence[_Who], results: Mapping[_Who, Results]) -> str:
    """`, as do `snap` and 2 more`: those that are right in as many of the same trials and are not compared below."""
    ours = results[best]
    same = [
        who
        for who in others
        if who not in [(m, 0) for m in _AGAINST]
        and results[who].keys() == ours.keys()
        and sum(results[who].values()) == sum(ours.values())
    ]
    more = [f"{len(same) - _NAMED} more"] * (len(same) > _NAMED)
    return f", as many as {listed_words([*map(_named, same[:_NAMED]), *more])}" if same else ""


def _compared(ours: _Who, other: _Who, results: Mapping[_Who, Results]) -> str:
    """A sentence that counts both, and what that tells; nothing where they have no trial in common."""
    c = contrast(results[ours], results[other])
    if c is None:
        return ""
    counted = (
        f"{_named(other)} succeeds in {c.theirs:,} of the same {c.trials:,}"
        if c.trials == len(results[ours])
        else f"Of the {c.trials:,} trials that both have, {_named(other)} succeeds in {c.theirs:,} and {_named(ours)} "
        f"in {c.ours:,}"
    )
    return f"{counted}{_told(ours, c)}."


def _told(ours: _Who, c: Contrast) -> str:
    """What the counts of a pair tell."""
    if c.seeds < FEWEST_SEEDS:
        return ""
    points = 100 * abs(c.difference)
    low, high = (100 * x for x in c.interval)
    between = f"95 % interval {low:+.1f} to {high:+.1f}"
    if c.sure:
        least, most = sorted((abs(low), abs(high)))
        return (
            f": {_named(ours)} succeeds {'more' if low > 0 else 'less'} often, by {points:.1f} points "
            f"(95 % interval {least:.1f} to {most:.1f})"
        )
    if c.interval.low >= -ALIKE_WITHIN and c.interval.high <= ALIKE_WITHIN:
        return f": as often, to within {max(-low, high):.1f} points (95 % interval of the difference)"
    if c.difference == 0.0:
        return f": as many, but {c.seeds:,} seeds leave room for a difference (in points: {between})"
    ahead = f": {_named(ours)} is {points:.1f} points {'ahead' if c.difference > 0 else 'behind'}"
    if not low <= 0.0 <= high:
        return f"{ahead}, but too few seeds differ to tell it from chance (better at {c.better}, worse at {c.worse})"
    more = f"; if as many differ on, {c.enough:,} seeds would" if (c.enough or 0) > c.seeds else ""
    return f"{ahead}, which {c.seeds:,} seeds do not tell from chance ({between}{more})"


def _reach(half: Sequence[HalfLevel]) -> str:
    """Where its curve over the level falls to one half; of several settings the worst and the best."""
    ends = sorted(half, key=lambda h: (h.beyond == "above", h.level or 0.0, h.largest))
    worst, best = (_half(ends[i]) for i in (0, -1))
    every = f"in each of {len(ends)} settings."
    if len(ends) == 1:
        between = "" if ends[0].level is None else f" (95 % interval: {_between(ends[0])})"
        return f"Its curve over the level {worst}{between}."
    if ends[0].beyond == "above":
        return f"Its curve over the level stays above one half up to the largest tried, {every}"
    if worst == best:
        return f"Its curve over the level {worst}; so {every}"
    return f"In the worst of {len(ends)} settings its curve over the level {worst}; in the best it {best}."


def _half(h: HalfLevel) -> str:
    if h.level is not None:
        return f"falls to one half at level {h.text}"
    if h.beyond == "above":
        return f"stays above one half up to level {h.largest:g}, the largest tried"
    lowest = f"from level {h.smallest:g}, the smallest tried above 0, on" if h.beyond == "below" else "even at level 0"
    return f"is below one half {lowest}"


def _between(h: HalfLevel) -> str:
    """`1.1 to 1.6`, `below 0.2`, `above 3.2`; `any level` where it is open at both ends."""
    return {"any": "any level"}.get(h.interval_text, h.interval_text.replace("<", "below").replace(">", "above"))
