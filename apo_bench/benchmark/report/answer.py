"""The sentences at the top of a report: counts, then conclusions.

No sentence states more than its counts: an interval only with enough seeds, "more often" only if the difference is
beyond chance, "as often" only if the interval lies close around 0.
"""

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np

from apo_bench.benchmark.analysis import (
    CONDITION_FIELDS,
    FEWEST_SEEDS,
    Contrast,
    HalfLevel,
    Records,
    Results,
    contrast,
    format_percent,
    format_percent_interval,
    format_points,
    pool_rate,
    rank_method,
)
from apo_bench.benchmark.analysis.over_seeds import PooledRate
from apo_bench.io import format_count
from apo_bench.records import CORRECTOR, knows_truth, uses_contacts
from apo_bench.records.run.trials import trials_of

ALIKE_WITHIN = 0.05
"""Two methods are alike only where the whole interval of their difference is within this, to either side of 0."""
_AGAINST = ("uncorrected", "paper", "contact", CORRECTOR)
"""The best method is compared with these; if none of them was tried, with the next best."""
_GIVEN = "given"
_SAME_TRIAL = (
    *(name for name in CONDITION_FIELDS if name not in ("method", "contact_source", "max_reobservations")),
    "seed",
)
_Who = tuple[str, int]
"""A method, and how often it might look again."""


def answer(records: Records, half_levels: Sequence[HalfLevel]) -> str:
    """The sentences, with methods in backquotes; of trials with wrong relations only where there are no others."""
    results, kinds = _results(records)
    if not results:
        return "No trial counts here: either no demonstration was right itself, or only the oracle was tried."
    quoted = ", ".join(f"`{kind}`" for kind in kinds)
    wrong = "" if kinds == [_GIVEN] else f" Correctors used the contacts {quoted} here, not `{_GIVEN}`."
    best, *others = _ranked(results)
    if not any(own.success.any() for own in results.values()):
        counts = ", ".join(f"{_named(who)} in 0 of {len(results[who].seed):,}" for who in (best, *others))
        return f"No method succeeds in any trial: {counts}.{wrong}"
    own = pool_rate(results[best])
    half = [
        h
        for h in half_levels
        if (h.condition.method, h.condition.max_reobservations) == best and h.condition.contact_source in kinds
    ]
    known = [(m, 0) for m in _AGAINST if (m, 0) in results and (m, 0) != best] or others[:1]
    reached = _reach(half) if own.seeds >= FEWEST_SEEDS else ""
    sentences = (_counted(best, own), reached, *(_compared(best, who, results) for who in known), _few(own))
    return " ".join(filter(None, sentences)) + wrong


def _results(records: Records) -> tuple[dict[_Who, Results], list[str]]:
    """Successes of each method, and what correctors were told: the right relations, or else what there is."""
    trials = trials_of(records)
    counts = ~np.isnan(trials.number("success")) & ~np.isnan(trials.number("noise_mm"))
    counted = trials.where(counts & ~trials.holds("method", knows_truth))
    informed = counted.holds("method", uses_contacts)
    kinds = sorted(counted.where(informed).distinct("contact_source")) or [_GIVEN]
    kinds = [_GIVEN] if _GIVEN in kinds else kinds
    # the one trial of a method that is told nothing would count once for each kind of relations that others hear
    here = counted.where(np.where(informed, counted.holds("contact_source", kinds.__contains__), len(kinds) == 1))
    trial = here.groups((*_SAME_TRIAL, *["contact_source"] * (len(kinds) > 1))).of
    methods = here.groups(("method", "max_reobservations"))
    results = {}
    for k, who in enumerate(methods.keys):
        own = methods.of == k
        results[who[0], who[1]] = Results(trial[own], here.number("seed")[own], here.number("success")[own])
    return results, kinds


def _ranked(results: Mapping[_Who, Results]) -> list[_Who]:
    """The best first, by trials that all have that were tried in half of all conditions or more."""
    most = max(len(own.trial) for own in results.values())
    widely = {who: own for who, own in results.items() if 2 * len(own.trial) >= most}
    common = reduce(np.intersect1d, (own.trial for own in widely.values()))

    def rate(who: _Who) -> float:
        shared = np.isin(results[who].trial, common) | (len(common) == 0)
        return float(results[who].success[shared].mean())

    return sorted(widely, key=lambda who: (-rate(who), rank_method(who[0]), who))


def _named(who: _Who) -> str:
    """`contact`, or `contact-robust` with 2 reobservations."""
    method, reobservations = who
    return f"`{method}`" + f" with {reobservations} reobservations" * (reobservations > 0)


def _counted(who: _Who, own: PooledRate) -> str:
    """`95 of 100 trials (95.0 %; 95 % interval 88.8 to 97.8 %)`."""
    between = "" if own.seeds < FEWEST_SEEDS else f"; 95 % interval {format_percent_interval(own.interval)}"
    trials = format_count(own.trials, "trial")
    return f"{_named(who)} succeeds in {own.right:,} of {trials} ({format_percent(own.right / own.trials)}{between})."


def _few(own: PooledRate) -> str:
    """A sentence where there are too few seeds for an interval."""
    if own.seeds >= FEWEST_SEEDS:
        return ""
    seeds = "1 seed is" if own.seeds == 1 else f"{own.seeds} seeds are"
    return f"{seeds} too few for an interval: from {FEWEST_SEEDS} on, a difference at every seed is beyond chance."


def _reach(half: Sequence[HalfLevel]) -> str:
    """Where its curve over the level falls to one half; of several settings the worst."""
    if not half:
        return ""
    worst = min(half, key=lambda h: (h.beyond == "above", h.noise_mm or 0.0, h.largest))
    which = "each" if worst.beyond == "above" else "the worst"
    where = f"In {which} of {len(half)} settings its" if len(half) > 1 else "Its"
    if worst.beyond == "above":
        return f"{where} success stays above one half up to noise level {worst.largest:g}, the largest tried."
    if worst.beyond == "below":
        return f"{where} success is below one half from noise level {worst.smallest:g}, the smallest tried, on."
    return f"{where} success falls to one half at noise level {worst.text} (surely: {worst.sure_text})."


def _compared(ours: _Who, other: _Who, results: Mapping[_Who, Results]) -> str:
    """A sentence that counts both, and what that tells; nothing where they have no trial in common."""
    c = contrast(results[ours], results[other])
    if c is None:
        return ""
    counted = f"{_named(other)} succeeds in {c.theirs:,} of the same {c.trials:,}"
    if c.trials < len(results[ours].trial):
        both = f"{_named(other)} succeeds in {c.theirs:,} and {_named(ours)} in {c.ours:,}"
        counted = f"Of the {c.trials:,} trials that both have, {both}"
    return f"{counted}{'' if c.seeds < FEWEST_SEEDS else f': {_told(ours, c)}'}."


def _told(ours: _Who, c: Contrast) -> str:
    """What the counts of a pair tell."""
    size = f"{100 * abs(c.difference):.1f} points"
    between = f"95 % interval {format_points(c.interval)}"
    if c.sure:
        return f"{_named(ours)} succeeds {'more' if c.difference > 0 else 'less'} often, by {size} ({between})"
    widest = max(-c.interval.low, c.interval.high)
    if widest <= ALIKE_WITHIN:
        return f"as often, to within {100 * widest:.1f} points (95 % interval of the difference)"
    if c.difference == 0.0:
        return f"as many, but {c.seeds:,} seeds leave room for a difference (in points: {between})"
    ahead = f"{_named(ours)} is {size} {'ahead' if c.difference > 0 else 'behind'}"
    return f"{ahead}, which {c.seeds:,} seeds do not tell from chance ({between})"
