"""The paired comparisons of a sweep as a table for people."""

from __future__ import annotations

from collections.abc import Sequence

from apo_bench.report.page.markup import Table
from apo_bench.report.tables.paired import p_text, share_text
from apo_bench.statistics.paired import Paired
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Interval
from apo_bench.statistics.settings import level_of, setting_of

HEAD = (
    *("scenario", "conditions", "method", "against", "level", "pairs", "both", "it alone", "other alone", "neither"),
    *("difference [points]", "p", "p adjusted", "recovered", "harmed", "free error, difference [mm]"),
)


def pair_table(found: Sequence[Paired]) -> Table:
    """One line per cell, method and reference."""
    return Table(HEAD, [_line(p) for p in found], words=4)


def _line(p: Paired) -> tuple[object, ...]:
    where = (p.place.scenario, ", ".join(setting_of(p.place).conditions()), p.place.method, p.reference)
    level = level_label(*level_of(p), p.place.noise)
    counts = (p.pairs, p.both, p.only_method, p.only_reference, p.neither)
    mended = (share_text(p.recovered), share_text(p.harmed))
    return (
        *where,
        level,
        *counts,
        points(p.difference, p.interval),
        p_text(p.p),
        p_text(p.p_adjusted),
        *mended,
        _free(p),
    )


def points(difference: float | None, interval: Interval) -> str | None:
    """`+4.0 (-0.3 to +9.1)`."""
    if difference is None:
        return None
    return f"{100 * difference:+.1f} ({100 * interval.low:+.1f} to {100 * interval.high:+.1f})"


def _free(p: Paired) -> str | None:
    if p.free_mm is None:
        return None
    between = "" if p.free_interval is None else f" ({p.free_interval.low:+.3f} to {p.free_interval.high:+.3f})"
    return f"{p.free_mm:+.3f}{between}, n {p.planned}"
