"""A comparison in words: tables for the terminal and the page, the page itself, and one JSON object."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError
from apo_bench.io import check_folders, write_file
from apo_bench.records import KEY, row_key
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_file import limits_of, scenario_files
from apo_bench.report.comparison.compare import Agreement, Changed, Comparison, Side
from apo_bench.report.facts import value_words
from apo_bench.report.page.page import Section, page
from apo_bench.report.tables.table import Column, Table, fill
from apo_bench.report.trials import NUMBERS, verdict, why
from apo_bench.statistics import FEWEST_SEEDS, percent, percents

_AGREEMENT = (
    "The same trials in both: how often success is the same, with Wilson's interval, and how often stage and code of "
    "a failure are as well. Trials of one seed share their random numbers, so those intervals are too narrow where "
    "disagreements come in bunches; *same in all* counts the seeds with which every trial has the same verdict in "
    "both, and these are independent. *Right in the first alone* are trials that the second lost. The difference of "
    "success is the second minus the first, with Tango's interval for pairs (95 %), over trials too. Trials whose "
    "demonstration was not right in either are left out here."
)
_NUMBERS = "Of trials that have the number in both: in how many it is not exactly the same, and by how much at most."
_CELLS = (
    "Rates over all trials of each side; alone and the difference, second minus first, over the trials that they share."
)
_MOST_LISTED = 2000
"""Changed trials that are listed."""
_DIFFERENCE = fill("{verdicts.difference:points} ({verdicts.interval:points})")
_WHERE = (
    Column("scenario", "scenario", "place.scenario", words=True),
    Column("conditions", "conditions", "place.conditions", words=True),
    Column("method", "method", "place.method", words=True),
    Column("level", "level", "place.level_words", words=True),
)


def comparison_tables(comparison: Comparison) -> dict[str, Table]:
    """By the name of their file: verdicts that agree, by scenario and of all; how far numbers of the same trials are
    apart; rates of both, cell by cell; trials whose verdicts differ, with sentences and commands; and what is not the
    same in both."""
    agreement = (
        Column("scenario", "scenario", words=True),
        Column("trials", "trials", "same.trials"),
        Column("same verdict", "same verdict", fill("{same.successes} ({same.rate:percent2})")),
        Column("95 %", "95 %", fill("{same.interval:percents2}")),
        Column("seeds", "seeds", "same_everywhere.trials"),
        Column("same in all", "same in all", fill("{same_everywhere.successes} ({same_everywhere.rate:percent2})")),
        Column("95 % 2", "95 %", fill("{same_everywhere.interval:percents2}")),
        Column(
            "same stage and code", "same stage and code", fill("{same_ending.successes} ({same_ending.rate:percent2})")
        ),
        Column("right in the first alone", "right in the first alone", "verdicts.only_first"),
        Column("right in the second alone", "right in the second alone", "verdicts.only_second"),
        Column("difference of success [points]", "difference of success [points]", _DIFFERENCE),
    )
    numbers = (
        Column("number", "number", _label, words=True),
        Column("trials", "trials", "both"),
        Column("differ", "differ"),
        Column("largest difference", "largest difference", fill("{most:.3g}")),
        Column("in one alone", "in one alone", "alone"),
    )
    cells = (
        *_WHERE,
        Column("first", "first", fill("{first.rate:percent}, n {first.trials}")),
        Column("second", "second", fill("{second.rate:percent}, n {second.trials}")),
        Column("shared", "shared", "verdicts.shared"),
        Column("first alone", "first alone", "verdicts.only_first"),
        Column("second alone", "second alone", "verdicts.only_second"),
        Column("difference [points]", "difference [points]", _DIFFERENCE),
    )
    changed = (
        *_WHERE,
        Column("seed", "seed", words=True),
        Column("first", "first", fill("{first.verdict} {first.why}"), words=True),
        Column("in words", "in words", "first.sentence", words=True),
        Column("second", "second", fill("{second.verdict} {second.why}"), words=True),
        Column("in words 2", "in words", "second.sentence", words=True),
        Column("command of the first", "command of the first", "first.command", words=True),
        Column("command of the second", "command of the second", "second.command", words=True),
    )
    first, second = (str(side.folder) for side in (comparison.first, comparison.second))
    differences = (
        Column("what", "what", words=True),
        Column(first, first, "first", words=True),
        Column(second, second, "second", words=True),
    )
    listed = [_listed(each, comparison) for each in comparison.changed[:_MOST_LISTED]]
    unlike = [{"what": d.what, "first": _value(d.first), "second": _value(d.second)} for d in comparison.differences]
    return {
        "agreement": Table(comparison.agreements, agreement, note=_AGREEMENT),
        "numbers": Table(comparison.numbers, numbers, note=_NUMBERS),
        "cells": Table(comparison.cells, cells, note=_CELLS),
        "changed": Table(listed, changed, "No verdict differs."),
        "differences": Table(unlike, differences, "Nothing that is said of them differs."),
    }


def in_words(comparison: Comparison) -> str:
    """The whole in some sentences, counts first."""
    first, second = comparison.alone
    shared = f"{_trials(comparison.shared)} in both, {first:,} in the first alone, {second:,} in the second alone."
    identical = f"{_trials(comparison.identical)} the same to the last digit."
    return f"{shared} {_agreed(comparison.agreements[-1])} {identical}"


def _agreed(total: Agreement) -> str:
    """How many verdicts agree, and at how many seeds all of them do; seeds are independent, trials are not."""
    same = total.same
    seeds = total.same_everywhere
    if not same.trials:
        return "None of them counts: no demonstration was right itself."
    _, only_first, only_second = total.verdicts
    counted = f", {total.excluded_in_one:,} counted in one of the two alone" * bool(total.excluded_in_one)
    sure = f"95 % interval {percents(seeds.interval)} of seeds"
    if seeds.trials < FEWEST_SEEDS:
        sure = f"too few for an interval: from {FEWEST_SEEDS} on there is one"
    return (
        f"Verdicts agree in {same.successes:,} of {same.trials:,} ({percent(same.rate, 2)}): {only_first:,} right in "
        f"the first alone, {only_second:,} in the second alone{counted}. All of them agree at {seeds.successes:,} of "
        f"{seeds.trials:,} seed{'s' * (seeds.trials != 1)} ({sure})."
    )


def write_comparison(comparison: Comparison, folder: Path) -> Path:
    """Write the page and its tables (CSV and Parquet); returns the page.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = comparison_tables(comparison)
    folders = [str(side.folder) for side in (comparison.first, comparison.second)]
    names = [Path(each).resolve().name for each in folders]
    count = len(comparison.changed)
    listed = f"; the first {_MOST_LISTED:,} are listed" if count > _MOST_LISTED else ""
    changed = ("text", f"{count:,} of {comparison.shared:,} trials{listed}.")
    sections = [
        Section("verdicts", "Verdicts", [("table", tables["agreement"])]),
        Section("changed", "Trials whose verdicts differ", [changed, ("table", tables["changed"])]),
        Section("numbers", "Numbers", [("table", tables["numbers"])]),
        Section("rates", "Rates", [("table", tables["cells"])]),
        Section("differences", "What is not the same", [("table", tables["differences"])]),
    ]
    html = page(" against ".join(names), in_words(comparison), folders, sections)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_folders([folder])
        for name, table in tables.items():
            table.write(folder / f"{name}.csv")
        write_file(folder / "compare.html", html)
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return folder / "compare.html"


def comparison_form(comparison: Comparison) -> dict[str, Any]:
    """A comparison as JSON holds it."""
    return {
        "schema": "apo-bench/comparison/1",
        "first": str(comparison.first.folder),
        "second": str(comparison.second.folder),
        "verdict": "success",
        "shared": comparison.shared,
        "first_alone": comparison.alone[0],
        "second_alone": comparison.alone[1],
        "identical": comparison.identical,
        "agreements": [_agreement_form(a) for a in comparison.agreements],
        "numbers": [a._asdict() for a in comparison.numbers],
        "differences": [d._asdict() for d in comparison.differences],
        "changed": [_changed_form(each, comparison) for each in comparison.changed],
    }


def _agreement_form(a: Agreement) -> dict[str, Any]:
    return {
        "scenario": a.scenario,
        "trials": a.same.trials,
        "same_verdict": a.same.successes,
        "same_verdict_rate": a.same.rate,
        "same_verdict_low_95": a.same.interval.low,
        "same_verdict_high_95": a.same.interval.high,
        "seeds": a.same_everywhere.trials,
        "same_verdicts_in_all": a.same_everywhere.successes,
        "same_verdicts_in_all_low_95": a.same_everywhere.interval.low,
        "same_verdicts_in_all_high_95": a.same_everywhere.interval.high,
        "same_stage_and_code": a.same_ending.successes,
        "right_in_first_alone": a.verdicts.only_first,
        "right_in_second_alone": a.verdicts.only_second,
        "excluded_in_one": a.excluded_in_one,
        "difference": a.verdicts.difference,
        "difference_low_95": a.verdicts.interval.low,
        "difference_high_95": a.verdicts.interval.high,
    }


def _changed_form(changed: Changed, comparison: Comparison) -> dict[str, Any]:
    listed = _listed(changed, comparison)
    names = ("verdict", "stage", "code", "sentence", "command")
    sides = {side: {name: listed[side][name] for name in names} for side in ("first", "second")}
    return dict(zip(KEY, row_key(changed.first), strict=True)) | sides


def _listed(changed: Changed, comparison: Comparison) -> dict[str, Any]:
    """What a table, and JSON, say of a trial."""
    sides = {
        "first": _ended(changed.first, comparison.first),
        "second": _ended(changed.second, comparison.second),
    }
    return {"place": changed.place, "seed": changed.first["seed"]} | sides


def _ended(row: Mapping[str, Any], side: Side) -> dict[str, Any]:
    return {
        "verdict": verdict(row),
        "why": why(row),
        "stage": row["failure_stage"],
        "code": row["failure_code"],
        "sentence": row["sentence"],
        "command": replay_command(row, scenario_files(side.run), limits_of(side.run)),
    }


def _label(change: Any) -> str:
    return NUMBERS[change.name]


def _trials(n: int) -> str:
    return "1 trial is" if n == 1 else f"{n:,} trials are"


def _value(x: Any) -> str:
    return "not said" if x is None else value_words(x)
