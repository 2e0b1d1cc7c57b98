"""Printing of JSON, texts and tables."""

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


def say(text: str, as_json: bool) -> None:
    """Print a text for people, unless a JSON object is all that is printed."""
    if not as_json:
        typer.echo(text)


def print_written(*paths: Path | None, as_json: bool = False) -> None:
    """Name the files that were written, unless a JSON object is all that is printed."""
    if any(paths):
        say("\n" + "\n".join(f"Wrote {path}" for path in paths if path is not None), as_json)


def print_columns(lines: Iterable[Sequence[str]]) -> None:
    """Print cells below each other; on a terminal they are wrapped within their column."""
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
    """Print a table of `rich` after an empty line."""
    typer.echo()
    make_console(narrowest).print(table)


def make_console(narrowest: int = 80) -> Any:
    """A console as wide as the terminal; where there is none, wide enough to keep lines whole."""
    from rich.console import Console

    least = narrowest if sys.stdout.isatty() else 160
    return Console(width=max(least, Console().width), highlight=False, markup=False)
