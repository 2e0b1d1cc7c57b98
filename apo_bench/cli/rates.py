"""Tables of a sweep on the terminal."""

from collections.abc import Sequence

import typer
from rich.table import Table as TerminalTable

from apo_bench.benchmark.analysis import ConditionResult
from apo_bench.benchmark.report.tables.conditions import make_condition_table
from apo_bench.benchmark.report.tables.table import Table
from apo_bench.cli.shared import print_table
from apo_bench.io import clean


def print_report_table(table: Table) -> None:
    """Print the columns of a table that people read."""
    printed = TerminalTable(box=None, pad_edge=False)
    for column in table.shown:
        printed.add_column(column.head, justify="left" if column.words else "right")
    for line in table.lines:
        printed.add_row(*map(clean, line))
    print_table(printed)


def print_rates(cells: Sequence[ConditionResult]) -> None:
    """Print success rates with their intervals, and how many trials do not count."""
    print_report_table(make_condition_table(cells))
    if excluded := sum(cell.excluded for cell in cells):
        typer.echo(f"Trials that do not count, because the demonstration itself failed: {excluded:,}.")
