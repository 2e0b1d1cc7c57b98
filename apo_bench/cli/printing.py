"""How commands print: JSON, names with texts, tables as wide as the terminal."""

import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import typer


def print_json(form: Any) -> None:
    """Print one JSON object."""
    typer.echo(json.dumps(form, allow_nan=False))


def print_answer(form: Any, lines: Iterable[str], as_json: bool) -> None:
    """Print one JSON object, or lines for people."""
    typer.echo(json.dumps(form, allow_nan=False) if as_json else "\n".join(lines))


def say(text: str, as_json: bool) -> None:
    """Print a text for people, but nothing beside a JSON object."""
    if not as_json:
        typer.echo(text)


def print_lines(lines: Sequence[tuple[str, str]]) -> None:
    """Names with their texts below each other."""
    width = max(len(name) for name, _ in lines)
    typer.echo("\n".join(f"{name:{width}}  {text}" for name, text in lines))


def print_tables(*tables: Any) -> None:
    """Print tables of `rich`, an empty line before each."""
    for table in tables:
        typer.echo()
        console().print(table)


def console(narrowest: int = 110) -> Any:
    """A console as wide as the terminal, or wide enough to keep lines whole where there is none."""
    from rich.console import Console

    least = narrowest if sys.stdout.isatty() else 160
    return Console(width=max(least, Console().width), highlight=False, markup=False)
