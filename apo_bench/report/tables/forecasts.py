"""What was said beforehand against what then happened: stated uncertainty, predicted failures, recognised contacts."""

from collections.abc import Sequence

from apo_bench.records import knows_relations
from apo_bench.report.tables.table import Column, Table, axis, millimetres, rate_columns
from apo_bench.statistics import Calibration, Confusion, Rate, Recognition, level_label, percent, percents


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
