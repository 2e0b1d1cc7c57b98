"""Tables of success: rates of conditions, pairs of methods, and half levels."""

from collections.abc import Sequence

from apo_bench.benchmark.analysis import ConditionResult, HalfLevel, PairedComparison
from apo_bench.benchmark.report.tables.table import (
    Table,
    TableColumn,
    format_endings,
    list_condition_columns,
    list_interval_columns,
)
from apo_bench.records import TrialConfig

_AXES = (
    "noise",
    "contact_source",
    "max_reobservations",
    "robot_error",
    "ft_sensor",
    "assumed_robot_error",
    "min_predicted_success",
)
"""Settings whose column people see only if some condition differs from the default."""


def make_condition_table(cells: Sequence[ConditionResult]) -> Table:
    """Return the table of success rates, one line per condition."""
    unusual = {name for name in _AXES if any(getattr(c, name) != getattr(TrialConfig, name) for c in cells)}
    min_predicted_success = "min_predicted_success" in unusual
    has_prediction = any(c.predicted_success is not None for c in cells)

    # a column of a setting; without a head, it is in files only
    def axis(name: str) -> TableColumn:
        return TableColumn(name, name * (name in unusual), text=f"{{words.{name}}}", words=True)

    return Table(
        cells,
        (
            TableColumn("scenario", "scenario", words=True),
            TableColumn("clearance_mm", "clearance", text="{clearance_mm:g} mm", words=True),
            axis("noise"),
            axis("contact_source"),
            TableColumn("human_error_scale", "human error", text="{words.human_error_scale}", words=True),
            TableColumn("noise_mm", "noise level", text="{noise_words}", words=True),
            TableColumn("noise_deg"),
            TableColumn("tightness"),
            TableColumn("method", "method", words=True),
            TableColumn("grasp"),
            TableColumn("fidelity"),
            *map(axis, _AXES[2:]),
            TableColumn("", "success", "rate", "{rate:percent}"),
            TableColumn("", "95 % interval", "interval", "{interval:percents}"),
            TableColumn("trials", "n"),
            TableColumn("successes"),
            TableColumn("rate"),
            *list_interval_columns(),
            TableColumn("executed", value="executed.trials"),
            TableColumn("executed_rate", value="executed.rate"),
            *list_interval_columns("executed.interval", "executed_low_95", "executed_high_95"),
            TableColumn("abstained", "abstained" * min_predicted_success),
            TableColumn(
                "wrong_when_executed",
                "wrong when executed" * min_predicted_success,
                text="{wrong_when_executed:percent}",
            ),
            TableColumn("predicted_success", "predicted success" * has_prediction, text="{predicted_success:percent}"),
            TableColumn("brier"),
            TableColumn("as_demonstrated", value="demonstrated"),
            TableColumn("as_demonstrated_rate", "as demonstrated", "demonstrated_rate", "{demonstrated_rate:percent}"),
            TableColumn("loose_successes"),
            TableColumn("loose_rate", "loose", text="{loose_rate:percent}"),
            TableColumn("excluded"),
            TableColumn("failures", "failures", _describe_all_endings, "{failures:endings}", words=True),
        ),
    )


def _describe_all_endings(cell: ConditionResult) -> str:
    """Format all endings of a condition, for files."""
    return format_endings(cell.failures, most=None)


def make_pair_table(pairs: Sequence[PairedComparison]) -> Table:
    """Return the table of paired comparisons, one line per condition and reference."""
    return Table(
        pairs,
        (
            *list_condition_columns(),
            TableColumn("reference", "against", words=True),
            TableColumn("pairs", "pairs"),
            TableColumn("only_method"),
            TableColumn("only_reference"),
            TableColumn(
                "",
                "right: both, it alone, other alone, neither",
                "both",
                "{both}, {only_method}, {only_reference}, {neither}",
            ),
            TableColumn("difference", "difference [points]", text="{difference:points} ({interval:points})"),
            *list_interval_columns(),
            TableColumn("p_mcnemar", "p (adjusted)", "p", "{p:p} ({p_adjusted:p})"),
            TableColumn("p_adjusted"),
            TableColumn("reference_failed", value="recovered.trials"),
            TableColumn(
                "recovered",
                "recovered",
                "recovered.successes",
                "{recovered.successes} of {recovered.trials} ({recovered.interval:percents})",
            ),
            TableColumn("recovery_rate", value="recovered.rate"),
            *list_interval_columns("recovered.interval", "recovery_low_95", "recovery_high_95"),
            TableColumn("reference_right", value="harmed.trials"),
            TableColumn(
                "harmed",
                "harmed",
                "harmed.successes",
                "{harmed.successes} of {harmed.trials} ({harmed.interval:percents})",
            ),
            TableColumn("harm_rate", value="harmed.rate"),
            *list_interval_columns("harmed.interval", "harm_low_95", "harm_high_95"),
            TableColumn("planned"),
            TableColumn(
                "free_difference_mm",
                "free error, difference [mm]",
                "free_mm",
                "{free_mm:signed} ({free_interval.low:signed} to {free_interval.high:signed}), n {planned}",
            ),
            *list_interval_columns("free_interval", "free_low_95_mm", "free_high_95_mm"),
        ),
        "No method shares a condition with `uncorrected` or `paper`, with which methods are paired.",
        (
            "Over the same seeds: at how many of them both methods succeeded, one alone, or neither; the difference of "
            "their success rates in points with Tango's score interval for paired proportions; McNemar's exact "
            "p-value, and in brackets the same adjusted for all comparisons of the sweep (Holm). *Recovered* is the "
            "share of the other's failures at which the method succeeded, *harmed* the share of the other's successes "
            "at which it failed. The last column has the mean difference of the errors of planned poses in directions "
            "that contacts leave free, with Student's t interval. All intervals are of 95 %."
        ),
    )


def make_half_level_table(levels: Sequence[HalfLevel]) -> Table:
    """Return the table of half levels, one line per method and setting; in files an estimate outside is empty."""
    return Table(
        levels,
        (
            *list_condition_columns(levels=False),
            TableColumn("smallest_level", value="smallest"),
            TableColumn("largest_level", value="largest"),
            TableColumn("trials", "n"),
            TableColumn("half_level", "half success at noise level", "noise_mm", "{text}"),
            TableColumn("surely_over", "surely", text="{sure_text}"),
            TableColumn("surely_under"),
        ),
        "The noise level did not vary.",
        (
            "The noise level at which success falls to one half, read along its logarithm. *Surely* is from the last "
            "level with success surely over one half to the first surely under it, whatever the curve between them "
            "(exact binomial tests, 95 %); *any* where neither is known."
        ),
    )
