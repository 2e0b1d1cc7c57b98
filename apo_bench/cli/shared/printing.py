"""Print JSON, texts and tables."""

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import typer

from apo_bench.io import align_columns, clean


def print_json(form: Any) -> None:
    """Print one JSON object."""
    typer.echo(json.dumps(form, allow_nan=False))


def print_text(text: str, as_json: bool) -> None:
    """Print a text for people, unless the command prints a JSON object only."""
    if not as_json:
        typer.echo(text)


def print_written(*paths: Path | None, as_json: bool = False) -> None:
    """Print the names of written files, unless the command prints a JSON object only."""
    if any(paths):
        print_text("\n" + "\n".join(f"Wrote {path}" for path in paths if path is not None), as_json)


def print_columns(lines: Iterable[Sequence[str]]) -> None:
    """Print rows of cells in aligned columns; on a terminal, cells are wrapped within their column."""
    from rich.table import Table

    cleaned = [[clean(cell) for cell in cells] for cells in lines]
    if not sys.stdout.isatty():
        typer.echo("\n".join(align_columns(cleaned)))
        return
    table = Table(box=None, pad_edge=False, show_header=False)
    for cells in cleaned:
        table.add_row(*cells)
    make_console().print(table)


def print_table(table: Any, narrowest: int = 110) -> None:
    """Print a table of `rich` after an empty line, at least `narrowest` characters wide."""
    typer.echo()
    make_console(narrowest).print(table)


def make_console(narrowest: int = 80) -> Any:
    """Return a console as wide as the terminal, at least `narrowest`; without a terminal at least 160 characters."""
    from rich.console import Console

    least = narrowest if sys.stdout.isatty() else 160
    return Console(width=max(least, Console().width), highlight=False, markup=False)
