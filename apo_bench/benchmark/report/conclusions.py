"""The sentences at the top of a report: counts, then conclusions.

No sentence claims more than its counts support. There is an interval only with enough seeds, "more often" only for a
significant difference, and "as often" only if the interval lies close around 0.
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
from apo_bench.records.run.trials import make_trials

ALIKE_WITHIN = 0.05
"""Two methods count as equal only if the whole interval of their difference lies within this around 0."""
_AGAINST = ("uncorrected", "paper", "contact", CORRECTOR)
"""The best method is compared with these methods; if none of them was tried, with the second best."""
_GIVEN = "given"
_SAME_TRIAL = (  # settings that identify a trial, whatever the method
    *(name for name in CONDITION_FIELDS if name not in ("method", "contact_source", "max_reobservations")),
    "seed",
)
_Who = tuple[str, int]
"""A method, and the reobservations allowed."""


def write_answer(records: Records, half_levels: Sequence[HalfLevel]) -> str:
    """Return the sentences, with methods in backquotes.

    Trials with wrong contacts count only if there are no trials with the given ones.
    """
    results, kinds = _collect_results(records)
    if not results:
        return "No trial counts here: either no demonstration was right itself, or only the oracle was tried."
    quoted = ", ".join(f"`{kind}`" for kind in kinds)
    wrong = "" if kinds == [_GIVEN] else f" Correctors used the contacts {quoted} here, not `{_GIVEN}`."
    best, *others = _rank_methods(results)
    if not any(own.success.any() for own in results.values()):
        counts = ", ".join(f"{_format_method(who)} in 0 of {len(results[who].seed):,}" for who in (best, *others))
        return f"No method succeeds in any trial: {counts}.{wrong}"
    own = pool_rate(results[best])
    half = [
        h
        for h in half_levels
        if (h.condition.method, h.condition.max_reobservations) == best and h.condition.contact_source in kinds
    ]
    known = [(m, 0) for m in _AGAINST if (m, 0) in results and (m, 0) != best] or others[:1]
    reached = _describe_half_level(half) if own.seeds >= FEWEST_SEEDS else ""
    sentences = (
        _describe_rate(best, own),
        reached,
        *(_describe_comparison(best, who, results) for who in known),
        _note_few_seeds(own),
    )
    return " ".join(filter(None, sentences)) + wrong


def _collect_results(records: Records) -> tuple[dict[_Who, Results], list[str]]:
    """Return the results of each method, and the contact sources of the trials that count.

    Only trials with the given contacts count; if there are none, those of all contact sources.
    """
    trials = make_trials(records)
    counts = ~np.isnan(trials.number("success")) & ~np.isnan(trials.number("noise_mm"))
    counted = trials.where(counts & ~trials.holds("method", knows_truth))
    informed = counted.holds("method", uses_contacts)
    kinds = sorted(counted.where(informed).distinct("contact_source")) or [_GIVEN]
    kinds = [_GIVEN] if _GIVEN in kinds else kinds
    # a method without contacts has one trial per seed; it is left out if several contact sources count
    here = counted.where(np.where(informed, counted.holds("contact_source", kinds.__contains__), len(kinds) == 1))
    trial = here.groups((*_SAME_TRIAL, *["contact_source"] * (len(kinds) > 1))).of
    methods = here.groups(("method", "max_reobservations"))
    results = {}
    for k, who in enumerate(methods.keys):
        own = methods.of == k
        results[who[0], who[1]] = Results(trial[own], here.number("seed")[own], here.number("success")[own])
    return results, kinds


def _rank_methods(results: Mapping[_Who, Results]) -> list[_Who]:
    """Return methods with the best first, by the trials that all of them have.

    Methods with less than half as many trials as the largest number are left out.
    """
    most = max(len(own.trial) for own in results.values())
    widely = {who: own for who, own in results.items() if 2 * len(own.trial) >= most}
    common = reduce(np.intersect1d, (own.trial for own in widely.values()))

    def rate(who: _Who) -> float:
        # without common trials each method counts all of its own
        shared = np.isin(results[who].trial, common) | (len(common) == 0)
        return float(results[who].success[shared].mean())

    return sorted(widely, key=lambda who: (-rate(who), rank_method(who[0]), who))


def _format_method(who: _Who) -> str:
    """Format a method: `contact`, or `contact-robust` with 2 reobservations."""
    method, reobservations = who
    return f"`{method}`" + f" with {reobservations} reobservations" * (reobservations > 0)


def _describe_rate(who: _Who, own: PooledRate) -> str:
    """Return `contact succeeds in 95 of 100 trials (95.0 %; 95 % interval 88.8 to 97.8 %).`"""
    between = "" if own.seeds < FEWEST_SEEDS else f"; 95 % interval {format_percent_interval(own.interval)}"
    trials = format_count(own.trials, "trial")
    share = format_percent(own.right / own.trials)
    return f"{_format_method(who)} succeeds in {own.right:,} of {trials} ({share}{between})."


def _note_few_seeds(own: PooledRate) -> str:
    """Return a sentence if there are too few seeds for an interval, else an empty text."""
    if own.seeds >= FEWEST_SEEDS:
        return ""
    seeds = "1 seed is" if own.seeds == 1 else f"{own.seeds} seeds are"
    return f"{seeds} too few for an interval: from {FEWEST_SEEDS} on, a difference at every seed is beyond chance."


def _describe_half_level(half: Sequence[HalfLevel]) -> str:
    """Return a sentence on the noise level at which success falls to one half; of several settings, the worst."""
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


def _describe_comparison(ours: _Who, other: _Who, results: Mapping[_Who, Results]) -> str:
    """Return a sentence that compares the counts of two methods; empty if they have no trial in common."""
    c = contrast(results[ours], results[other])
    if c is None:
        return ""
    counted = f"{_format_method(other)} succeeds in {c.theirs:,} of the same {c.trials:,}"
    if c.trials < len(results[ours].trial):
        both = f"{_format_method(other)} succeeds in {c.theirs:,} and {_format_method(ours)} in {c.ours:,}"
        counted = f"Of the {c.trials:,} trials that both have, {both}"
    return f"{counted}{'' if c.seeds < FEWEST_SEEDS else f': {_describe_difference(ours, c)}'}."


def _describe_difference(ours: _Who, c: Contrast) -> str:
    """Return the conclusion from the counts of a pair: more or less often, as often, or undecided."""
    size = f"{100 * abs(c.difference):.1f} points"
    between = f"95 % interval {format_points(c.interval)}"
    if c.sure:
        return f"{_format_method(ours)} succeeds {'more' if c.difference > 0 else 'less'} often, by {size} ({between})"
    widest = max(-c.interval.low, c.interval.high)  # the end of the interval that is farther from 0
    if widest <= ALIKE_WITHIN:
        return f"as often, to within {100 * widest:.1f} points (95 % interval of the difference)"
    if c.difference == 0.0:
        return f"as many, but {c.seeds:,} seeds leave room for a difference (in points: {between})"
    ahead = f"{_format_method(ours)} is {size} {'ahead' if c.difference > 0 else 'behind'}"
    return f"{ahead}, which {c.seeds:,} seeds do not tell from chance ({between})"
