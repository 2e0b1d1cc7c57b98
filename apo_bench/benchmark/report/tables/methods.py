"""Tables of lines that summarise several conditions: gaps, probing, effort, time, calibration, prediction."""

from collections.abc import Sequence
from typing import Any

from apo_bench.benchmark.analysis import Line, format_percent
from apo_bench.benchmark.report.tables.table import Table, TableColumn, list_condition_columns, list_interval_columns


def _list_words(*names: str) -> tuple[TableColumn, ...]:
    """Return text columns with the names of settings."""
    return tuple(TableColumn(name, name, words=True) for name in names)


_METHOD = _list_words("scenario", "method")


def make_gap_table(lines: Sequence[Line]) -> Table:
    """Return the table of contact gaps, one line per condition."""
    return Table(
        lines,
        (
            *list_condition_columns(),
            TableColumn("trials", "n"),
            TableColumn("observed_5"),
            TableColumn("observed_median_mm", "observed [mm]", text="{observed_median_mm:.3f}"),
            TableColumn("observed_95"),
            TableColumn("planned_5"),
            TableColumn("planned_median_mm", "planned [mm]", text="{planned_median_mm:.3f}"),
            TableColumn("planned_95", "95 % are below [mm]", text="{planned_95:.3f}"),
        ),
        "No method that corrects had a plan, so there is no gap to compare.",
        (
            "The largest distance of any face from the one it should touch, at the observed and at the planned poses: "
            "medians, and in the drawing bands from the 5th to the 95th percentile of the trials. Gaps below 0.001 mm "
            "are drawn there. `uncorrected` plans the observed poses."
        ),
    )


def make_probing_table(lines: Sequence[Line]) -> Table:
    """Return the table of a probing robot's base error, one line per condition."""
    heads = {"drawn": "drawn with", "assumed": "assumed", "estimated": "estimated", "std": "stated std"}
    return Table(
        lines,
        (
            *list_condition_columns(),
            TableColumn("trials", "n"),
            TableColumn("probe_contacts", "probe contacts", text="{probe_contacts:.1f}"),
            TableColumn("rejected", "rejected"),
            *(
                TableColumn(f"{name}_{unit}", f"{head} [{unit}]", text=f"{{{name}_{unit}:.2f}}")
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


def make_effort_table(lines: Sequence[Line]) -> Table:
    """Return the table of extra steps and simulated time, one line per scenario and method."""
    return Table(
        lines,
        (
            *_METHOD,
            TableColumn("trials", "right"),
            TableColumn("extra_steps", "extra steps", text="{extra_steps:.1f}"),
            TableColumn("sim_time_s", "simulated", text="{sim_time_s:.0f} s"),
            TableColumn("placed_part_shift_mm", "placed part moved at most", text="{placed_part_shift_mm:.2f} mm"),
        ),
        "No trial was right.",
        (
            "Of successful trials: the operations that were undone and done again, the simulated time, and largest "
            "displacement of a placed part."
        ),
    )


def make_time_table(lines: Sequence[Line]) -> Table:
    """Return the table of wall times, one line per scenario and method."""
    return Table(
        lines,
        (
            *_METHOD,
            TableColumn("trials", "n"),
            TableColumn("trial_5_s", "5 % are below [s]", text="{trial_5_s:.2f}"),
            TableColumn("trial_median_s", "median [s]", text="{trial_median_s:.2f}"),
            TableColumn("trial_95_s", "95 % are below [s]", text="{trial_95_s:.2f}"),
            TableColumn("trial_sum_s", "together [s]", text="{trial_sum_s:.0f}"),
        ),
        "There is no timing.jsonl beside the rows, so times are not known.",
        "Without compilation and demonstration; in the drawing medians, and lines from the 5th to the 95th percentile.",
    )


def make_work_table(lines: Sequence[Line]) -> Table:
    """Return the table of wall times of workers, one line per worker."""
    return Table(
        lines,
        (
            *_list_words("host", "worker"),
            TableColumn("trials", "rows"),
            TableColumn("busy_s", "busy [s]", text="{busy_s:.0f}"),
            TableColumn("rows_per_minute", "rows per minute", text="{rows_per_minute:.1f}"),
        ),
    )


def make_calibration_table(lines: Sequence[Line]) -> Table:
    """Return the table of stated uncertainty against the truth; one line per scenario, noise, contacts and method."""
    share = "{{{0}.rate:percent}} of {{{0}.trials}}".format
    return Table(
        lines,
        (
            *_list_words("scenario", "noise", "contact_source", "method"),
            TableColumn("planned", "n"),
            TableColumn("covered", "covered", text=share("covered")),
            TableColumn("fixed_mm", "fixed error [mm]", text="{fixed_mm:.3f}"),
            TableColumn("fixed_over_clearance", "over clearance", text="{fixed_over_clearance:.2f}"),
            TableColumn("free_mm", "free error [mm]", text="{free_mm:.3f}"),
            TableColumn("failed_tests", "test fails", text=share("failed_tests")),
            TableColumn("culprits", "culprit", text=share("culprits")),
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


def make_confusion_table(lines: Sequence[Line]) -> Table:
    """Return the table of predictions against outcomes, one line per scenario and method, and one over all."""
    return Table(
        lines,
        (
            *_METHOD,
            TableColumn("", "n", "executed"),
            TableColumn("predicted_fit_fitted", "fit: fitted"),
            TableColumn("predicted_fit_failed", "fit: failed"),
            TableColumn("predicted_fail_fitted", "fail: fitted"),
            TableColumn("predicted_fail_failed", "fail: failed"),
            TableColumn("agreement", "agreement", text="{agreement:percent}"),
            TableColumn("same_operation", "right operation", text="{same_operation} of {stopped}"),
            TableColumn("stopped"),
            TableColumn("not_executed", "not executed"),
            TableColumn("excluded", "excluded"),
        ),
        note=(
            "Before it is executed, a plan is predicted to *fit* or *fail*; then physics decides: *fitted* means made "
            "as demonstrated. The operation is right if the robot stopped at the predicted one. A method without a "
            "plan has nothing executed."
        ),
    )


def make_detection_table(lines: Sequence[Line]) -> Table:
    """Return the table of detected contacts, one line per scenario, noise, pose and contact source, and noise level."""
    return Table(
        lines,
        (
            *_list_words("scenario", "noise", "pose_source", "contact_source", "human_error_scale"),
            TableColumn("noise_mm", "noise [mm]", words=True),
            TableColumn("noise_deg", "noise [deg]", words=True),
            TableColumn("demonstrations"),
            TableColumn("complete", "all right", "complete.successes", "{complete.successes} of {demonstrations}"),
            TableColumn("rate", "rate", "complete.rate", "{complete.rate:percent}"),
            TableColumn("", "95 % interval", "complete.interval", "{complete.interval:percents}"),
            *list_interval_columns("complete.interval"),
            TableColumn("right"),
            TableColumn("missed", "missed"),
            TableColumn("false", "false"),
            TableColumn("precision", "precision", text="{precision:percent2}"),
            TableColumn("recall", "recall", text="{recall:percent2}"),
        ),
        "No method used detected contacts.",
        (
            "Detected contacts against those of the scenario: in how many demonstrations all were right and none too "
            "many; how many detected contacts are right (precision), and how many right ones were detected (recall)."
        ),
    )


def summarise_predictions(line: Line) -> str:
    """Summarise a line of predictions: `Predicted: 129 of 134 executed trials ended as predicted (96.3 %, ...`."""
    executed: Any = line["executed"]
    if not executed:
        return "Predicted: nothing, since no trial was executed."
    trials = "1 executed trial" if executed == 1 else f"{executed:,} executed trials"
    return (
        f"Predicted: {line['right']:,} of {trials} ended as predicted ({format_percent(line['agreement'])}, counted by "
        f"as_demonstrated); failures that were not predicted: {line['predicted_fit_failed']}, warnings that were "
        f"wrong: {line['predicted_fail_fitted']}."
    )
