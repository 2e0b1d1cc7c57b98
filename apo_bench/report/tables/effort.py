"""What replays take, and what a sweep took."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table
from apo_bench.statistics.effort import Effort, TrialTimes, Work

_NOTE = (
    "Of trials that were right: the operations that were undone and done again, the simulated time, and how far a part "
    "that was in place was pushed at most."
)


def effort_table(efforts: Sequence[Effort]) -> Table:
    """One line per scenario and method; for people."""
    columns = (
        Column("scenario", "scenario", words=True),
        Column("method", "method", words=True),
        Column("trials", "right"),
        Column("extra_operations", "extra operations", text=lambda e: f"{e.extra_operations:.1f}"),
        Column("sim_seconds", "simulated", text=lambda e: f"{e.sim_seconds:.0f} s"),
        Column("pushed_mm", "pushed at most", text=lambda e: f"{e.pushed_mm:.2f} mm"),
    )
    return Table(efforts, columns, "No trial was right.", _NOTE)


def time_table(times: Sequence[TrialTimes]) -> Table:
    """Wall times, one line per scenario and method."""
    columns = (
        Column("scenario", "scenario", words=True),
        Column("method", "method", words=True),
        Column("trials", "n"),
        Column("trial_5_s", "5 % are below [s]", lambda t: t.low, lambda t: f"{t.low:.2f}"),
        Column("trial_median_s", "median [s]", lambda t: t.median, lambda t: f"{t.median:.2f}"),
        Column("trial_95_s", "95 % are below [s]", lambda t: t.high, lambda t: f"{t.high:.2f}"),
        Column("trial_sum_s", "together [min]", lambda t: t.total, lambda t: f"{t.total / 60:.1f}"),
    )
    return Table(times, columns)


def work_table(work: Sequence[Work]) -> Table:
    """One line per worker; for people."""
    columns = (
        Column("host", "host", words=True),
        Column("worker", "worker", words=True),
        Column("trials", "rows"),
        Column("busy_s", "busy [min]", text=lambda w: f"{w.busy_s / 60:.1f}"),
        Column("rows_per_minute", "rows per minute", text=lambda w: f"{w.rows_per_minute:.1f}"),
    )
    return Table(work, columns)
