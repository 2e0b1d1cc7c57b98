"""What a person reads on the terminal: tables of rates, reports, the list of scenarios."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from apo_bench.benchmark.analysis import ConditionResult, confusions
from apo_bench.benchmark.report.tables.conditions import condition_table
from apo_bench.benchmark.report.tables.methods import prediction_summary
from apo_bench.benchmark.report.tables.table import Column
from apo_bench.benchmark.report.tables.table import Table as Data
from apo_bench.cli.printing import console
from apo_bench.io import clean, has_parquet
from apo_bench.records import TrialRecord
from apo_bench.scenario.scenario import Scenario

if TYPE_CHECKING:
    from apo_bench.benchmark.report.comparison.compare import Comparison
    from apo_bench.benchmark.report.report import Report

_MOST_NAMES = 8
"""Settings that differ, named on the terminal."""


def print_table(table: Data) -> None:
    """A table for people."""
    printed = Table(box=None, pad_edge=False)
    for column in table.shown:
        printed.add_column(column.head, justify="left" if column.words else "right")
    for line in table.lines:
        printed.add_row(*map(clean, line))
    console().print(printed)


def print_scenarios(scenarios: Sequence[Scenario]) -> None:
    """Name, operations, title and condition in the paper of each."""
    columns = (
        Column("name", "scenario", words=True),
        Column("operations", "operations", lambda s: len(s.assembly), words=True),
        Column("title", "title", words=True),
        Column("paper", "paper", words=True),
    )
    print_table(Data(scenarios, columns))


def print_cells(cells: Sequence[ConditionResult]) -> None:
    """Success rates with their intervals."""
    print_table(condition_table(cells))
    excluded = sum(c.excluded for c in cells)
    if excluded:
        left = "1 row is" if excluded == 1 else f"{excluded:,} rows are"
        console().print(f"{left} left out, since the demonstration itself was not right.")


def print_report(report: Report) -> None:
    """The answer, how often plans predicted what happened, and where everything was written."""
    lines = [prediction_summary(report.confusions[-1])]
    if report.no_pictures:
        drawn = "1 failure was" if report.pictures == 1 else f"{report.pictures} failures were"
        lines.append(f"{drawn} drawn. Not drawn: {'; '.join(report.no_pictures)}.")
    lines.append(f"Answer:  {report.answer.replace('`', '')}")
    same = "the same as .parquet" if has_parquet() else "as .parquet too with the package pyarrow"
    lines.append(f"Tables:  {report.tables['conditions']} and {len(report.tables) - 1} more there, {same}")
    if report.figures:
        lines.append(f"Figures: {report.figures[0]} and {len(report.figures) - 1} more there")
    lines.append(f"Report:  {report.page}")
    for line in lines:
        console().print(clean(line))


def print_comparison(comparison: Comparison) -> None:
    """How far two sweeps agree, and what is not the same in them."""
    from apo_bench.benchmark.report.comparison.text import comparison_tables, in_words

    console().print(clean(in_words(comparison)))
    print_table(comparison_tables(comparison)["agreement"])
    names = [line["what"] for line in comparison.differences]
    more = f" and {len(names) - _MOST_NAMES} more" * (len(names) > _MOST_NAMES)
    differ = clean(f"Not the same: {', '.join(names[:_MOST_NAMES])}{more}")
    console().print(differ if names else "Made with the same.")


def print_prediction(rows: Iterable[TrialRecord]) -> None:
    """In one line, how often plans predicted what happened."""
    console().print(prediction_summary(confusions(rows)[-1]))
