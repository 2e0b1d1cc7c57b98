"""Tables of lines that are counted over many conditions."""

from collections.abc import Sequence
from typing import Any

from apo_bench.benchmark.analysis import Line, percent
from apo_bench.benchmark.report.tables.table import Column, Table, condition_columns, interval_columns

_METHOD = (Column("scenario", "scenario", words=True), Column("method", "method", words=True))


def gap_table(lines: Sequence[Line]) -> Table:
    """One line per condition."""
    return Table(
        lines,
        (
            *condition_columns(),
            Column("trials", "n"),
            Column("observed_5"),
            Column("observed_median_mm", "observed [mm]", text="{observed_median_mm:.3f}"),
            Column("observed_95"),
            Column("planned_5"),
            Column("planned_median_mm", "planned [mm]", text="{planned_median_mm:.3f}"),
            Column("planned_95", "95 % are below [mm]", text="{planned_95:.3f}"),
        ),
        "No method that corrects had a plan, so there is no gap to compare.",
        (
            "The largest distance of any face from the one it should touch, at the observed and at the planned poses: "
            "medians, and in the drawing bands from the 5th to the 95th percentile of the trials. Gaps below 0.001 mm "
            "are drawn there. `uncorrected` plans the observed poses."
        ),
    )


def probing_table(lines: Sequence[Line]) -> Table:
    """One line per condition of a robot that probes."""
    heads = {"drawn": "drawn with", "assumed": "assumed", "estimated": "estimated", "std": "stated std"}
    return Table(
        lines,
        (
            *condition_columns(),
            Column("trials", "n"),
            Column("probe_contacts", "probe contacts", text="{probe_contacts:.1f}"),
            Column("rejected", "rejected"),
            *(
                Column(f"{name}_{unit}", f"{head} [{unit}]", text=f"{{{name}_{unit}:.2f}}")
                for unit in ("mm", "deg")
                for name, head in heads.items()
            ),
        ),
        "No robot probed.",
        (
            "How far the base of a robot that probes (`+probe`) is off at the middle of the poses: by the standard "
            "deviation of its error, by the one it assumes, by its final estimate, and the standard deviation that it "
            "states of that. All are root mean squares of vectors: the square root of three times a standard "
            "deviation per axis. *Rejected* are probe contacts that contradicted the others, of all trials together."
        ),
    )


def effort_table(lines: Sequence[Line]) -> Table:
    """One line per scenario and method."""
    return Table(
        lines,
        (
            *_METHOD,
            Column("trials", "right"),
            Column("extra_steps", "extra steps", text="{extra_steps:.1f}"),
            Column("sim_time_s", "simulated", text="{sim_time_s:.0f} s"),
            Column("displaced_mm", "pushed at most", text="{displaced_mm:.2f} mm"),
        ),
        "No trial was right.",
        (
            "Of successful trials: the operations that were undone and done again, the simulated time, and how far a "
            "finished part was pushed at most."
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
    """One line per scenario, noise, contact source and method."""
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
            "Over every noise level, human error scale and clearance. *Covered* is how often the truth lies in the "
            "95 % region that a correction states. Errors are root mean squares of the planned poses, in directions "
            "that the contacts fix, also over the clearance, and in those that they leave free. A test *fails* where "
            "the stated noise does not explain the correction: a false alarm with given contacts, a hit with wrong "
            "ones. The *culprit* is how often the wrong contact, if it is one of those that were given, is in the "
            "ambiguity set of a failed test."
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
            "Before it is executed, a plan is predicted to *fit* or *fail*; then physics decides: *fitted* means made "
            "as demonstrated. The operation is right if the robot stopped at the predicted one. A method without a "
            "plan has nothing executed."
        ),
    )


def detection_table(lines: Sequence[Line]) -> Table:
    """One line per scenario, noise, pose source, contact source, human error scale and noise level."""
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
        "No method used detected contacts.",
        (
            "Detected contacts against those of the scenario: in how many demonstrations all were right and none too "
            "many; how many detected contacts are right (precision), and how many right ones were detected (recall)."
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
