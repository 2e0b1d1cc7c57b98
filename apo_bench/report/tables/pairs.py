"""Two methods over the same seeds, cell by cell."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table, interval_columns, level_text, place_columns, rate_columns
from apo_bench.statistics.paired import Paired
from apo_bench.statistics.rate_text import points, share, signed

_NOTE = (
    "Over the same seeds: at how many of them both methods were right, one alone, or neither; the difference of their "
    "success rates in points with Tango's score interval for paired proportions; McNemar's exact p-value, and in "
    "brackets the same adjusted for all comparisons of the sweep (Holm); *recovered*, the share of the seeds at which "
    "the other failed that it mended; *harmed*, the share of the seeds at which the other was right that it spoilt; "
    "and the mean difference of the errors of their planned goals in directions that contacts leave free, over seeds "
    "at which both had a plan, with Student's t interval (intervals are of 95 %). Negative errors are smaller than the "
    "other's. With no discordant pair an interval still reaches 384 / (n + 3.84) points to both sides: below 3 from "
    "125 on."
)


def pair_table(pairs: Sequence[Paired]) -> Table:
    """One line per cell, method and reference."""
    empty = "No method shares a cell with `none` or `paper`, with which methods are paired."
    return Table(pairs, _COLUMNS, empty, _NOTE)


def _counts(p: Paired) -> str:
    return f"{p.both}, {p.only_method}, {p.only_reference}, {p.neither}"


def _p(p: Paired) -> str | None:
    if p.p is None or p.p_adjusted is None:
        return None
    both = (f"{x:.3f}" if x >= 0.001 else "< 0.001" for x in (p.p, p.p_adjusted))
    return "{} ({})".format(*both)


def _free(p: Paired) -> str | None:
    if p.free_mm is None:
        return None
    ends = [signed(x, 3) for x in p.free_interval or ()]
    between = f" ({' to '.join(ends)})" if ends else ""
    return f"{signed(p.free_mm, 3)}{between}, n {p.planned}"


_COLUMNS = (
    *place_columns(),
    Column("reference", "against", words=True),
    Column("", "level", text=level_text),
    Column("pairs", "pairs"),
    Column("only_method"),
    Column("only_reference"),
    Column("", "right: both, it alone, other alone, neither", text=_counts),
    Column("difference", "difference [points]", text=lambda p: points(p.difference, p.interval)),
    *interval_columns(lambda p: p.interval),
    Column("p_mcnemar", "p (adjusted)", lambda p: p.p, _p),
    Column("p_adjusted"),
    *rate_columns(
        lambda p: p.recovered,
        ("reference_failed", "recovered", "recovery_rate", "recovery_low_95", "recovery_high_95"),
    ),
    Column("", "recovered", text=lambda p: share(p.recovered)),
    *rate_columns(lambda p: p.harmed, ("reference_right", "harmed", "harm_rate", "harm_low_95", "harm_high_95")),
    Column("", "harmed", text=lambda p: share(p.harmed)),
    Column("planned"),
    Column("free_difference_mm", "free error, difference [mm]", lambda p: p.free_mm, _free),
    *interval_columns(lambda p: p.free_interval, "free_low_95_mm", "free_high_95_mm"),
)
