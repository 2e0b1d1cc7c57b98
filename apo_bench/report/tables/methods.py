"""Tables with one line per method: how much noise it bears (the level of half success, the area under success over
level), what its replays take, and what a sweep took."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table, interval_columns, place_columns
from apo_bench.statistics import Effort, TrialTimes, Work, points
from apo_bench.statistics.levels.curves import Area, AreaDifference
from apo_bench.statistics.levels.half_level import HalfLevel

_WHERE = place_columns(lambda x: x.setting, levels=False)


def half_table(levels: Sequence[HalfLevel], areas: Sequence[Area]) -> Table:
    """One line per method and setting; in files a limit beyond the levels tried is empty."""
    known = {
        a.setting: f"{a.area:.3f} ({a.interval.low:.3f} to {a.interval.high:.3f}), {a.seeds} seeds"
        for a in areas
        if a.area is not None
    }
    return Table(
        levels,
        (
            *_WHERE,
            Column("smallest_level", value=lambda h: h.smallest),
            Column("largest_level", value=lambda h: h.largest),
            Column("trials", "n"),
            Column("half_level", value=lambda h: h.level),
            Column("", "half success at level (95 %)", text=lambda h: f"{h.text} ({h.interval_text})"),
            Column("low_95", value=lambda h: h.low),
            Column("high_95", value=lambda h: h.high),
            Column("surely_over", "surely", text=lambda h: h.sure_text),
            Column("surely_under"),
            Column("", "area (95 %)", text=lambda h: known.get(h.setting)),
        ),
        ("No level varied, so nothing is known of how success falls with it."),
        (
            "Where success falls to one half, read along the logarithm of the level, with a 95 % interval; *surely* "
            "is from the last level with success surely over one half to the first surely under it, whatever the "
            "curve between them. *Any* is an interval that is open at both ends, *none* is under one half even at "
            "level 0. The area is mean success over the logarithm of the level, from 0 to 1, of seeds that have a "
            "result at every level."
        ),
    )


def area_table(areas: Sequence[Area], differences: Sequence[AreaDifference]) -> Table:
    """Areas, whose reference is empty, and differences to those of a reference."""
    return Table(
        [*areas, *differences],
        (
            *_WHERE,
            Column("reference", "against", lambda a: getattr(a, "reference", None), words=True),
            Column("smallest_level", value=lambda a: min(a.levels)),
            Column("largest_level", value=lambda a: max(a.levels)),
            Column("seeds", "seeds"),
            Column("area", value=lambda a: a.area if isinstance(a, Area) else a.difference),
            Column(
                "",
                "difference of the areas [points]",
                text=lambda a: points(a.difference, a.interval) if isinstance(a, AreaDifference) else None,
            ),
            *interval_columns(lambda a: a.interval),
        ),
    )


def effort_table(efforts: Sequence[Effort]) -> Table:
    """One line per scenario and method; for people."""
    return Table(
        efforts,
        (
            Column("scenario", "scenario", words=True),
            Column("method", "method", words=True),
            Column("trials", "right"),
            Column("extra_operations", "extra operations", text=lambda e: f"{e.extra_operations:.1f}"),
            Column("sim_seconds", "simulated", text=lambda e: f"{e.sim_seconds:.0f} s"),
            Column("pushed_mm", "pushed at most", text=lambda e: f"{e.pushed_mm:.2f} mm"),
        ),
        "No trial was right.",
        (
            "Of trials that were right: the operations that were undone and done again, the simulated time, and how "
            "far a part that was in place was pushed at most."
        ),
    )


def time_table(times: Sequence[TrialTimes]) -> Table:
    """Wall times, one line per scenario and method."""
    return Table(
        times,
        (
            Column("scenario", "scenario", words=True),
            Column("method", "method", words=True),
            Column("trials", "n"),
            Column("trial_5_s", "5 % are below [s]", lambda t: t.low, lambda t: f"{t.low:.2f}"),
            Column("trial_median_s", "median [s]", lambda t: t.median, lambda t: f"{t.median:.2f}"),
            Column("trial_95_s", "95 % are below [s]", lambda t: t.high, lambda t: f"{t.high:.2f}"),
            Column("trial_sum_s", "together [min]", lambda t: t.total, lambda t: f"{t.total / 60:.1f}"),
        ),
    )


def work_table(work: Sequence[Work]) -> Table:
    """One line per worker; for people."""
    return Table(
        work,
        (
            Column("host", "host", words=True),
            Column("worker", "worker", words=True),
            Column("trials", "rows"),
            Column("busy_s", "busy [min]", text=lambda w: f"{w.busy_s / 60:.1f}"),
            Column("rows_per_minute", "rows per minute", text=lambda w: f"{w.rows_per_minute:.1f}"),
        ),
    )
