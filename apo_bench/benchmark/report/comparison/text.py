"""A comparison of two sweeps as tables, as an HTML page, and as a JSON object."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from apo_bench.benchmark.analysis import FEWEST_SEEDS, Interval, Line, format_percent, format_percent_interval
from apo_bench.benchmark.report.comparison.compare import Comparison
from apo_bench.benchmark.report.page.page import Section, render_page
from apo_bench.benchmark.report.run_facts import format_setting
from apo_bench.benchmark.report.tables.table import Table, TableColumn, make_template
from apo_bench.benchmark.report.trial_text import NUMBERS
from apo_bench.errors import InputError
from apo_bench.io import format_count, write_file

_AGREEMENT = (
    "The same trials in both: how often success is the same, with Wilson's interval, and how often stage and code of "
    "a failure are as well. Trials of one seed share their random numbers, so those intervals are too narrow where "
    "disagreements come in bunches; *same in all* counts the seeds with which every trial has the same verdict in "
    "both, and these are independent. *Right in the first alone* are trials that the second lost. The difference of "
    "success is the second minus the first, with Tango's interval for pairs (95 %), over trials too. Trials whose "
    "demonstration was not right in either are left out here."
)
_NUMBERS = "Of trials that have the number in both: in how many it is not exactly the same, and by how much at most."
_CONDITIONS = (
    "Rates over all trials of each side; alone and the difference, second minus first, over the trials that they share."
)
_MOST_LISTED = 2000
"""Most changed trials that are listed."""
# template of a difference with its interval
_DIFFERENCE = make_template("{difference:points} ({difference_low_95:points} to {difference_high_95:points})")
_WHERE = (  # columns that identify a condition
    TableColumn("scenario", "scenario", "condition.scenario", words=True),
    TableColumn("conditions", "conditions", "condition.description", words=True),
    TableColumn("method", "method", "condition.method", words=True),
    TableColumn("noise_mm", "noise level", "condition.noise_words", words=True),
)


def make_comparison_tables(comparison: Comparison) -> dict[str, Table]:
    """Return the tables by the name of their file: agreement, numbers, conditions, changed, differences."""
    agreement = (
        TableColumn("scenario", "scenario", words=True),
        TableColumn("trials", "trials"),
        TableColumn("same verdict", "same verdict", make_template("{same_verdict} ({same_verdict_rate:percent2})")),
        TableColumn("95 %", "95 %", make_template(_format_range("same_verdict"))),
        TableColumn("seeds", "seeds"),
        TableColumn(
            "same in all", "same in all", make_template("{same_verdicts_in_all} ({same_verdicts_in_all_rate:percent2})")
        ),
        TableColumn("95 % 2", "95 %", make_template(_format_range("same_verdicts_in_all"))),
        TableColumn("same stage and code", "same stage and code", "same_stage_and_code"),
        TableColumn("right in the first alone", "right in the first alone", "right_in_first_alone"),
        TableColumn("right in the second alone", "right in the second alone", "right_in_second_alone"),
        TableColumn("difference of success [points]", "difference of success [points]", _DIFFERENCE),
    )
    numbers = (
        TableColumn("number", "number", _format_label, words=True),
        TableColumn("trials", "trials", "both"),
        TableColumn("differ", "differ"),
        TableColumn("largest difference", "largest difference", make_template("{most:.3g}")),
        TableColumn("in one alone", "in one alone", "alone"),
    )
    conditions = (
        *_WHERE,
        TableColumn("first", "first", make_template("{first.rate:percent}, n {first.trials}")),
        TableColumn("second", "second", make_template("{second.rate:percent}, n {second.trials}")),
        TableColumn("shared", "shared"),
        TableColumn("first alone", "first alone", "right_in_first_alone"),
        TableColumn("second alone", "second alone", "right_in_second_alone"),
        TableColumn("difference [points]", "difference [points]", _DIFFERENCE),
    )
    changed = (
        *_WHERE,
        TableColumn("seed", "seed", words=True),
        TableColumn("first", "first", make_template("{first.verdict} {first.why}"), words=True),
        TableColumn("in words", "in words", "first.sentence", words=True),
        TableColumn("second", "second", make_template("{second.verdict} {second.why}"), words=True),
        TableColumn("in words 2", "in words", "second.sentence", words=True),
        TableColumn("command of the first", "command of the first", "first.command", words=True),
        TableColumn("command of the second", "command of the second", "second.command", words=True),
    )
    first, second = (str(side.folder) for side in (comparison.first, comparison.second))
    differences = (
        TableColumn("what", "what", words=True),
        TableColumn(first, first, _format_side("first"), words=True),
        TableColumn(second, second, _format_side("second"), words=True),
    )
    return {
        "agreement": Table(comparison.agreements, agreement, note=_AGREEMENT),
        "numbers": Table(comparison.numbers, numbers, note=_NUMBERS),
        "conditions": Table(comparison.conditions, conditions, note=_CONDITIONS),
        "changed": Table(comparison.changed[:_MOST_LISTED], changed, "No verdict differs."),
        "differences": Table(comparison.differences, differences, "Nothing that is said of them differs."),
    }


def describe_comparison(comparison: Comparison) -> str:
    """Summarise a comparison in some sentences, counts first."""
    first, second = comparison.alone
    shared = (
        f"{_format_trials(comparison.shared)} in both, {first:,} in the first alone, {second:,} in the second alone."
    )
    identical = f"{_format_trials(comparison.identical)} the same to the last digit."
    return f"{shared} {_describe_agreement(comparison.agreements[-1])} {identical}"


def _describe_agreement(total: Line) -> str:
    """Return how many verdicts agree, and at how many seeds all verdicts agree; only seeds are independent."""
    if not total["trials"]:
        return "None of them counts: no demonstration was right itself."
    counted = f", {total['excluded_in_one']:,} counted in one of the two alone" * bool(total["excluded_in_one"])
    seeds = Interval(total["same_verdicts_in_all_low_95"], total["same_verdicts_in_all_high_95"])
    sure = f"95 % interval {format_percent_interval(seeds)} of seeds"
    if total["seeds"] < FEWEST_SEEDS:
        sure = f"too few for an interval: from {FEWEST_SEEDS} on there is one"
    rate = format_percent(total["same_verdict_rate"], 2)
    return (
        f"Verdicts agree in {total['same_verdict']:,} of {total['trials']:,} ({rate}): "
        f"{total['right_in_first_alone']:,} right in the first alone, {total['right_in_second_alone']:,} in the second "
        f"alone{counted}. All of them agree at {total['same_verdicts_in_all']:,} of "
        f"{format_count(total['seeds'], 'seed')} ({sure})."
    )


def write_comparison(comparison: Comparison, folder: Path) -> Path:
    """Write the page and its tables (CSV and Parquet); return the path of the page.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = make_comparison_tables(comparison)
    folders = [str(side.folder) for side in (comparison.first, comparison.second)]
    names = [Path(each).resolve().name for each in folders]
    count = len(comparison.changed)
    listed = f"; the first {_MOST_LISTED:,} are listed" if count > _MOST_LISTED else ""
    changed = ("text", f"{count:,} of {comparison.shared:,} trials{listed}.")
    sections = [
        Section("verdicts", "Verdicts", [("table", tables["agreement"])]),
        Section("changed", "Trials whose verdicts differ", [changed, ("table", tables["changed"])]),
        Section("numbers", "Numbers", [("table", tables["numbers"])]),
        Section("rates", "Rates", [("table", tables["conditions"])]),
        Section("differences", "What is not the same", [("table", tables["differences"])]),
    ]
    html = render_page(" against ".join(names), describe_comparison(comparison), folders, sections)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, table in tables.items():
            table.write(folder / f"{name}.csv")
        write_file(folder / "compare.html", html)
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return folder / "compare.html"


def make_comparison_form(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as a JSON object."""
    return {
        "schema": "apo-bench/comparison/1",
        "first": str(comparison.first.folder),
        "second": str(comparison.second.folder),
        "verdict": "success",
        "shared": comparison.shared,
        "first_alone": comparison.alone[0],
        "second_alone": comparison.alone[1],
        "identical": comparison.identical,
        "agreements": comparison.agreements,
        "numbers": comparison.numbers,
        "differences": comparison.differences,
        "changed": [{name: x for name, x in line.items() if name != "condition"} for line in comparison.changed],
    }


def _format_range(name: str) -> str:
    """Return a template for an interval, from its lower to its upper end."""
    return f"{{{name}_low_95:hundredths}} to {{{name}_high_95:hundredths}} %"


def _format_label(line: Line) -> str:
    """Return the name of a record's number for people."""
    return NUMBERS[line["name"]]


def _format_trials(n: int) -> str:
    return "1 trial is" if n == 1 else f"{n:,} trials are"


def _format_side(name: str) -> Callable[[Line], str]:
    """Return a function that formats the value of a setting in one sweep, `first` or `second`."""
    return lambda line: "not said" if line[name] is None else format_setting(line[name])
