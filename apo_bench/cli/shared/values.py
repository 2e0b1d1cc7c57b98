"""Parse numbers, names and paths of the command line."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import typer

from apo_bench.errors import InputError

_Value = TypeVar("_Value")
# type -> description of a list of its values
_FORMS: dict[object, str] = {float: "numbers such as 0,0.5,1", int: "whole numbers such as 0,2,4", str: "names"}


def parse_list(text: str, option: str, kind: Callable[[str], _Value]) -> tuple[_Value, ...]:
    """Parse a list such as `0,0.5,1` into values of `float`, `int` or `str`."""
    entries = text.split(",")
    try:
        if all(map(str.strip, entries)):
            return tuple(kind(entry.strip()) for entry in entries)
    except ValueError:
        pass
    raise InputError(f"{option} takes {_FORMS[kind]}, separated by single commas, got '{text}'.")


def parse_path(text: str | Path) -> Path:
    """Return a path; raise an error for an empty text, which would stand for the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("the path is empty; name a file or a folder.")
    return Path(text)
