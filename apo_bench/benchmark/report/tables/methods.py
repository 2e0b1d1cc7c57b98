"""Tables of lines that are counted over many conditions, as the statistics make them: column -> value."""

from collections.abc import Sequence
from typing import Any

from apo_bench.benchmark.analysis import Line, percent
from apo_bench.benchmark.report.tables.table import Column, Table, interval_columns, place_columns

_METHOD = (Column("scenario", "scenario", words=True), Column("method", "method", words=True))


def gap_table(lines: Sequence[Line]) -> Table:
    """One line per cell."""
    return Table(
        lines,
        (
            *place_columns(),
            Column("trials", "n"),
            Column("seen_5"),
            Column("seen_median_mm", "as seen [mm]", text="{seen_median_mm:.3f}"),
            Column("seen_95"),
            Column("planned_5"),
            Column("planned_median_mm", "as planned [mm]", text="{planned_median_mm:.3f}"),
            Column("planned_95", "95 % are below [mm]", text="{planned_95:.3f}"),
        ),
        "No method that corrects had a plan, so there is no gap to compare.",
        (
            "The largest distance of any face from the one it should touch, as it was seen and as the method planned "
            "it: medians, and in the drawing bands from the 5th to the 95th percentile of the trials. What is below "
            "0.001 mm is drawn there. `none` plans what was seen."
        ),
    )


def felt_table(lines: Sequence[Line]) -> Table:
    """One line per cell of a robot that feels."""
    heads = {"drawn": "drawn with", "stated": "stated", "estimated": "estimated", "sure": "sure to"}
    return Table(
        lines,
        (
            *place_columns(),
            Column("trials", "n"),
            Column("probe_contacts", "probe_contacts", text="{probe_contacts:.1f}"),
            Column("refused", "refused"),
            *(
                Column(f"{name}_{unit}", f"{head} [{unit}]", text=f"{{{name}_{unit}:.2f}}")
                for unit in ("mm", "deg")
                for name, head in heads.items()
            ),
        ),
        "No robot felt.",
        (
            "How far the base of a robot that feels (`+probe`) is off at the middle of the goals: by what its error was "
            "drawn with, by what it was told, as it felt in the end, and how far that may be wrong, as it says itself. "
            "All are root mean squares of vectors: the square root of three times a standard deviation per axis. "
            "*Refused* are touches that contradicted the others, of all trials together."
        ),
    )


def effort_table(lines: Sequence[Line]) -> Table:
    """One line per scenario and method."""
    return Table(
        lines,
        (
            *_METHOD,
            Column("trials", "right"),
            Column("extra_operations", "extra operations", text="{extra_operations:.1f}"),
            Column("sim_time_s", "simulated", text="{sim_time_s:.0f} s"),
            Column("displaced_mm", "pushed at most", text="{displaced_mm:.2f} mm"),
        ),
        "No trial was right.",
        (
            "Of trials that were right: the operations that were undone and done again, the simulated time, and how "
            "far a part that was in place was pushed at most."
        ),
    )


def time_table(lines: Sequence[Line]) -> Table:
    """Wall times, one line per scenario and method."""
    return Table(
        lines,
        (
            *_METHOD,
            Column("trials", "n"),
            Column("trial_5_s", "5 % are below [s]", text="{trial_5_s:.2f}"),
            Column("trial_median_s", "median [s]", text="{trial_median_s:.2f}"),
            Column("trial_95_s", "95 % are below [s]", text="{trial_95_s:.2f}"),
            Column("trial_sum_s", "together [s]", text="{trial_sum_s:.0f}"),
        ),
        "There is no timing.jsonl beside the rows, so times are not known.",
        "Without compilation and demonstration; in the drawing medians, and lines from the 5th to the 95th percentile.",
    )


def work_table(lines: Sequence[Line]) -> Table:
    """One line per worker."""
    return Table(
        lines,
        (
            Column("host", "host", words=True),
            Column("worker", "worker", words=True),
            Column("trials", "rows"),
            Column("busy_s", "busy [s]", text="{busy_s:.0f}"),
            Column("rows_per_minute", "rows per minute", text="{rows_per_minute:.1f}"),
        ),
    )


def calibration_table(lines: Sequence[Line]) -> Table:
    """One line per scenario, noise, relations and method."""
    share = "{{{0}.rate:percent}} of {{{0}.trials}}".format
    return Table(
        lines,
        (
            Column("scenario", "scenario", words=True),
            Column("noise", "noise", words=True),
            Column("contact_source", "contact_source", words=True),
            Column("method", "method", words=True),
            Column("planned", "n"),
            Column("covered", "covered", text=share("covered")),
            Column("fixed_mm", "fixed error [mm]", text="{fixed_mm:.3f}"),
            Column("fixed_over_clearance", "over clearance", text="{fixed_over_clearance:.2f}"),
            Column("free_mm", "free error [mm]", text="{free_mm:.3f}"),
            Column("failed_tests", "test fails", text=share("failed_tests")),
            Column("culprits", "culprit", text=share("culprits")),
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


def confusion_table(lines: Sequence[Line]) -> Table:
    """One line per scenario and method, and one of them all."""
    return Table(
        lines,
        (
            *_METHOD,
            Column("", "n", "executed"),
            Column("predicted_fit_fitted", "fit: fitted"),
            Column("predicted_fit_failed", "fit: failed"),
            Column("predicted_fail_fitted", "fail: fitted"),
            Column("predicted_fail_failed", "fail: failed"),
            Column("agreement", "agreement", text="{agreement:percent}"),
            Column("same_operation", "right operation", text="{same_operation} of {stopped}"),
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


def recognition_table(lines: Sequence[Line]) -> Table:
    """One line per scenario, noise, eye, way of recognising, carelessness and level."""
    return Table(
        lines,
        (
            Column("scenario", "scenario", words=True),
            Column("noise", "noise", words=True),
            Column("pose_source", "pose_source", words=True),
            Column("contact_source", "contact_source", words=True),
            Column("human_error_scale", "human_error_scale", words=True),
            Column("noise_mm", "noise [mm]", words=True),
            Column("noise_deg", "noise [deg]", words=True),
            Column("demonstrations"),
            Column("complete", "all right", "complete.successes", "{complete.successes} of {demonstrations}"),
            Column("rate", "rate", "complete.rate", "{complete.rate:percent}"),
            Column("", "95 % interval", "complete.interval", "{complete.interval:percents}"),
            *interval_columns("complete.interval"),
            Column("right"),
            Column("missed", "missed"),
            Column("false", "false"),
            Column("precision", "precision", text="{precision:percent2}"),
            Column("recall", "recall", text="{recall:percent2}"),
        ),
        "No method was told relations that were recognised.",
        (
            "Contacts that were recognised, against those of the scenario: how many demonstrations had all right and "
            "none too many; how many of the recognised contacts are right (precision), and of the right ones were "
            "recognised (recall)."
        ),
    )


def prediction_summary(line: Line) -> str:
    """`Predicted: 129 of 134 executed trials ended as predicted (96.3 %, counted by as_demonstrated); failures ...`"""
    executed: Any = line["executed"]
    if not executed:
        return "Predicted: nothing, since no trial was executed."
    trials = "1 executed trial" if executed == 1 else f"{executed:,} executed trials"
    return (
        f"Predicted: {line['right']:,} of {trials} ended as predicted ({percent(line['agreement'])}, counted by "
        f"as_demonstrated); failures that were not predicted: {line['predicted_fit_failed']}, warnings that were "
        f"wrong: {line['predicted_fail_fitted']}."
    )
