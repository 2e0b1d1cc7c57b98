"""The commands `apo-bench report` and `apo-bench compare`: what a sweep says, and how two differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.errors import InputError

MOST_PICTURES = 100
Folder = Annotated[Path, typer.Argument(help="The folder that `sweep --out` wrote.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(report)


def report(
    folder: Folder,
    pictures: Annotated[int, typer.Option(help="Failures that are drawn at most; each is run again for it.")] = 6,
) -> None:
    """Write report.html, which opens anywhere, with tables (CSV, Parquet) and figures (SVG, PNG) beside it."""
    from apo_bench.benchmark.report import report as write_report
    from apo_bench.benchmark.terminal import print_cells, print_report

    if not 0 <= pictures <= MOST_PICTURES:
        raise InputError(f"--pictures {pictures} was given; a whole number from 0 to {MOST_PICTURES} is allowed.")
    made = write_report(folder, pictures)
    print_cells(made.cells)
    print_report(made)
