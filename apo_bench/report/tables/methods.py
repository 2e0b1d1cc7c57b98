"""Tables with one line per method: how much noise it bears (the level of half success, the area under success over
level), what its replays take, and what a sweep took.

What was said beforehand against what then happened: stated uncertainty, predicted failures, recognised contacts.
"""

from collections.abc import Sequence

from apo_bench.records import knows_relations
from apo_bench.report.tables.table import (
    Column,
    Table,
    axis,
    interval_columns,
    millimetres,
    place_columns,
    rate_columns,
)
from apo_bench.statistics import (
    Calibration,
    Confusion,
    Effort,
    Rate,
    Recognition,
    TrialTimes,
    Work,
    level_label,
    percent,
    percents,
    points,
)
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


def calibration_table(calibrations: Sequence[Calibration]) -> Table:
    """One line per scenario, noise, relations and method; for people."""
    return Table(
        calibrations,
        (
            Column("scenario", "scenario", words=True),
            Column("noise", "noise", words=True),
            Column(
                "relations", "relations", text=lambda c: c.relations if knows_relations(c.method) else "any", words=True
            ),
            Column("method", "method", words=True),
            Column("planned", "n"),
            Column("covered", "covered", text=lambda c: _share(c.covered)),
            Column("fixed_mm", "fixed error [mm]", text=lambda c: millimetres(c.fixed_mm)),
            Column(
                "fixed_over_clearance",
                "over clearance",
                text=lambda c: None if c.fixed_over_clearance is None else f"{c.fixed_over_clearance:.2f}",
            ),
            Column("free_mm", "free error [mm]", text=lambda c: millimetres(c.free_mm)),
            Column("failed_tests", "test fails", text=lambda c: _share(c.failed_tests)),
            Column("culprits", "culprit", text=lambda c: _share(c.culprits)),
        ),
        "No trial of a method but the oracle counts.",
        (
            "Over every level, carelessness and clearance. *Covered* is how often the truth lies in the 95 % region "
            "that a correction states. Errors are root mean squares of the planned goals, in directions that the "
            "contacts fix, also over the clearance, and in those that they leave free. A test *fails* where the "
            "stated noise does not explain the correction: a false alarm where the relations are as given, a catch "
            "where they are wrong. The *culprit* is how often the wrong relation, if it is one of those that were "
            "told, is in the ambiguity set of a failed test."
        ),
    )


def confusion_table(confusions: Sequence[Confusion]) -> Table:
    """One line per scenario and method, and one of them all."""
    return Table(
        confusions,
        (
            Column("scenario", "scenario", words=True),
            Column("method", "method", words=True),
            Column("", "n", text=lambda c: c.executed),
            Column("predicted_fit_fitted", "fit: fitted", lambda c: c.fit_fitted),
            Column("predicted_fit_failed", "fit: failed", lambda c: c.fit_failed),
            Column("predicted_fail_fitted", "fail: fitted", lambda c: c.fail_fitted),
            Column("predicted_fail_failed", "fail: failed", lambda c: c.fail_failed),
            Column("agreement", "agreement", text=lambda c: percent(c.agreement)),
            Column(
                "same_operation",
                "right operation",
                text=lambda c: f"{c.same_operation} of {c.stopped}" if c.stopped else None,
            ),
            Column("stopped"),
            Column("not_executed", "not executed"),
            Column("excluded", "excluded"),
        ),
        note=(
            "Before it is carried out a plan says whether it will *fit* or *fail*; then physics decides: *fitted* is "
            "made as demonstrated. An operation is right where the robot stopped at the one that was predicted. A "
            "method that gave no plan has nothing executed."
        ),
    )


def recognition_table(recognitions: Sequence[Recognition]) -> Table:
    """One line per place."""
    return Table(
        recognitions,
        (
            axis("scenario", head="scenario", words=True),
            axis(
                "noise",
                head="noise",
                text=lambda r: r.place.noise if r.place.eye == "noise" else r.place.eye,
                words=True,
            ),
            axis("eye"),
            axis("relations", head="relations", words=True),
            axis("careless", head="careless", words=True),
            axis(
                "level",
                name="level_mm",
                head="level",
                text=lambda r: level_label(r.place.level, r.place.level_deg, r.place.noise),
            ),
            axis("level_deg"),
            Column("demonstrations"),
            Column("complete", "all right", text=lambda r: f"{r.complete} of {r.demonstrations}"),
            *rate_columns(lambda r: r.all_right, ("", "", "rate", "low_95", "high_95")),
            Column("", "95 % interval", text=lambda r: percents(r.all_right.interval)),
            Column("right"),
            Column("missed"),
            Column("false"),
            Column("precision", "precision", text=lambda r: _percent(r.precision)),
            Column("recall", "recall", text=lambda r: _percent(r.recall)),
            Column("", "missed", text=lambda r: r.missed),
            Column("", "false", text=lambda r: r.false),
        ),
        "No method was told relations that were recognised.",
        (
            "Contacts that were recognised, against those of the scenario: how many demonstrations had all right and "
            "none too many; how many of the recognised contacts are right (precision), and of the right ones were "
            "recognised (recall)."
        ),
    )


def prediction_summary(c: Confusion) -> str:
    """`Predicted: 129 of 134 executed trials ended as predicted (96.3 %, counted by as_demonstrated); failures ...`"""
    if c.agreement is None:
        return "Predicted: nothing, since no trial was executed."
    trials = "1 executed trial" if c.executed == 1 else f"{c.executed:,} executed trials"
    return (
        f"Predicted: {c.right:,} of {trials} ended as predicted ({percent(c.agreement)}, counted by as_demonstrated); "
        f"failures that were not predicted: {c.fit_failed}, warnings that were wrong: {c.fail_fitted}."
    )


def _share(r: Rate) -> str | None:
    return f"{100 * r.successes / r.trials:.1f} % of {r.trials}" if r.trials else None


def _percent(x: float | None) -> str | None:
    return None if x is None else f"{100 * x:.2f} %"
