"""A comparison in words: tables for the terminal and the page, the page itself, and one JSON object."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError
from apo_bench.io import check_folders, write_file
from apo_bench.records import KEY, Row, row_key
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_folder import NUMBERS
from apo_bench.report.comparison.compare import Agreement, Comparison, Side
from apo_bench.report.page.report_page import page
from apo_bench.report.run.trials import limits_of, scenario_files, value_words, verdict, why
from apo_bench.report.tables.table import Column, Table, level_text
from apo_bench.statistics import (
    FEWEST_SEEDS,
    Cell,
    Rate,
    cell_place,
    percent,
    percents,
    place_of,
    points,
    setting_of,
)

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


def comparison_tables(comparison: Comparison) -> dict[str, Table]:
    """By the name of their file: verdicts that agree, by scenario and of all; how far numbers of the same trials are
    apart; rates of both, cell by cell; trials whose verdicts differ, with sentences and commands; and what is not the
    same in both."""
    agreement = (
        _words("scenario"),
        _both("trials", lambda a: a.same.trials),
        _both("same verdict", lambda a: _counted(a.same)),
        _both("95 %", lambda a: percents(a.same.interval, 2)),
        _both("seeds", lambda a: a.same_everywhere.trials),
        _both("same in all", lambda a: _counted(a.same_everywhere)),
        _both("95 %", lambda a: percents(a.same_everywhere.interval, 2), "95 % 2"),
        _both("same stage and code", lambda a: _counted(a.same_ending)),
        _both("right in the first alone", lambda a: a.only_first),
        _both("right in the second alone", lambda a: a.only_second),
        _both("difference of success [points]", lambda a: points(a.difference, a.interval)),
    )
    numbers = (
        _words("number", lambda a: NUMBERS[a.name]),
        _both("trials", lambda a: a.both),
        _both("differ"),
        _both("largest difference", lambda a: f"{a.most:.3g}" if a.both else None),
        _both("in one alone", lambda a: a.alone),
    )
    cells = (
        *_where(cell_place),
        _both("first", lambda p: _rate(p.first)),
        _both("second", lambda p: _rate(p.second)),
        _both("shared"),
        _both("first alone", lambda p: p.only_first),
        _both("second alone", lambda p: p.only_second),
        _both("difference [points]", lambda p: points(p.difference, p.interval)),
    )
    changed = (
        *_where(lambda pair: place_of(pair[0])),
        _words("seed", lambda pair: pair[0]["seed"]),
        _words("first", lambda pair: f"{verdict(pair[0])} {why(pair[0])}".strip()),
        _words("in words", lambda pair: pair[0].get("sentence")),
        _words("second", lambda pair: f"{verdict(pair[1])} {why(pair[1])}".strip()),
        _words("in words", lambda pair: pair[1].get("sentence"), "in words 2"),
        _words("command of the first", lambda pair: _command(pair[0], comparison.first)),
        _words("command of the second", lambda pair: _command(pair[1], comparison.second)),
    )
    differences = (
        _words("what"),
        _words(str(comparison.first.folder), lambda d: _value(d.first)),
        _words(str(comparison.second.folder), lambda d: _value(d.second)),
    )
    return {
        "agreement": Table(comparison.agreements, agreement, note=_AGREEMENT),
        "numbers": Table(comparison.numbers, numbers, note=_NUMBERS),
        "cells": Table(comparison.cells, cells, note=_CELLS),
        "changed": Table(comparison.changed[:_MOST_LISTED], changed, "No verdict differs."),
        "differences": Table(comparison.differences, differences, "Nothing that is said of them differs."),
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
    right = f"{total.only_first:,} right in the first alone, {total.only_second:,} in the second alone"
    counted = f", {total.excluded_in_one:,} counted in one of the two alone" * bool(total.excluded_in_one)
    if seeds.trials < FEWEST_SEEDS:
        sure = f"too few for an interval: from {FEWEST_SEEDS} on there is one"
    else:
        sure = f"95 % interval {percents(seeds.interval)} of seeds"
    return (
        f"Verdicts agree in {same.successes:,} of {same.trials:,} ({percent(same.rate, 2)}): {right}{counted}. All of "
        f"them agree at {seeds.successes:,} of {seeds.trials:,} seed{'s' * (seeds.trials != 1)} ({sure})."
    )


def _trials(n: int) -> str:
    return "1 trial is" if n == 1 else f"{n:,} trials are"


def write_comparison(comparison: Comparison, folder: Path) -> Path:
    """Write the page and its tables (CSV and Parquet); returns the page.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = comparison_tables(comparison)
    folders = [side.folder for side in (comparison.first, comparison.second)]
    count = len(comparison.changed)
    listed = f"; the first {_MOST_LISTED:,} are listed" if count > _MOST_LISTED else ""
    html = page(
        "compare.html",
        title=f"{folders[0].resolve().name} against {folders[1].resolve().name}",
        sections={
            "verdicts": "Verdicts",
            "changed": "Trials whose verdicts differ",
            "numbers": "Numbers",
            "rates": "Rates",
            "differences": "What is not the same",
        },
        answer=in_words(comparison),
        folders=folders,
        tables=tables,
        changed=f"{count:,} of {comparison.shared:,} trials{listed}.",
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_folders([folder])
        for name, table in tables.items():
            table.write_all(folder / f"{name}.csv")
        write_file(folder / "compare.html", html)
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return folder / "compare.html"


def comparison_form(comparison: Comparison) -> dict[str, Any]:
    """A comparison as JSON holds it."""
    sides = (comparison.first, comparison.second)
    return {
        "schema": ("apo-bench/comparison/1"),
        "first": str(comparison.first.folder),
        "second": str(comparison.second.folder),
        "verdict": "success",
        "shared": comparison.shared,
        "first_alone": comparison.alone[0],
        "second_alone": comparison.alone[1],
        "identical": comparison.identical,
        "agreements": [
            {
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
                "right_in_first_alone": a.only_first,
                "right_in_second_alone": a.only_second,
                "excluded_in_one": a.excluded_in_one,
                "difference": a.difference,
                "difference_low_95": a.interval.low,
                "difference_high_95": a.interval.high,
            }
            for a in comparison.agreements
        ],
        "numbers": [a._asdict() for a in comparison.numbers],
        "differences": [d._asdict() for d in comparison.differences],
        "changed": [
            dict(zip(KEY, row_key(pair[0]), strict=True))
            | {
                name: {
                    "verdict": verdict(row),
                    "stage": row["failure_stage"],
                    "code": row["failure_code"],
                    "sentence": row.get("sentence"),
                    "command": _command(row, side),
                }
                for name, row, side in zip(("first", "second"), pair, sides, strict=True)
            }
            for pair in comparison.changed
        ],
    }


def _both(head: str, value: Callable[[Any], object] | None = None, name: str = "") -> Column:
    """A column that files and people read alike; `name` is its own in files, where heads are not."""
    return Column(name or head, head, value)


def _words(head: str, value: Callable[[Any], object] | None = None, name: str = "") -> Column:
    """The same, of words."""
    return _both(head, value, name)._replace(words=True)


def _where(of: Callable[[Any], Any]) -> tuple[Column, ...]:
    return (
        _words("scenario", lambda x: of(x).scenario),
        _words("conditions", lambda x: ", ".join(setting_of(of(x)).conditions())),
        _words("method", lambda x: of(x).method),
        _words("level", lambda x: level_text(of(x))),
    )


def _counted(r: Rate) -> str:
    return f"{r.successes} ({percent(r.rate, 2)})"


def _rate(cell: Cell | None) -> str | None:
    return None if cell is None else f"{percent(cell.rate)}, n {cell.trials}"


def _value(x: Any) -> str:
    return "not said" if x is None else value_words(x)


def _command(row: Row, side: Side) -> str:
    return replay_command(row, scenario_files(side.run), limits_of(side.run))
