"""Texts of the command line as numbers, words and paths."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import typer

from apo_bench.errors import InputError, require

_Value = TypeVar("_Value")


def numbers(text: str, option: str) -> tuple[float, ...]:
    """`0,0.5,1` as numbers; whether they are allowed is checked where they are used."""
    return _read_list(text, option, float, "numbers with commas between them, such as 0,0.5,1,")


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """`0,2,4` as whole numbers."""
    return _read_list(text, option, int, "whole numbers with commas between them, such as 0,2,4,")


def words(text: str, option: str) -> tuple[str, ...]:
    """`oracle,none` as its entries."""
    entries = _read_list(text, option, str.strip, "words")
    require(
        all(entries), f"{option} '{text}' was given; at least one entry is needed, with single commas between them."
    )
    return entries


def _read_list(text: str, option: str, read: Callable[[str], _Value], allowed: str) -> tuple[_Value, ...]:
    try:
        return tuple(map(read, text.split(",")))
    except ValueError as error:
        raise InputError(f"{option} '{text}' was given; {allowed} are allowed.") from error


def path_given(text: str) -> Path:
    """A path that names something: the empty text would stand for the current folder."""
    if not text.strip():
        raise typer.BadParameter("an empty path was given; name a file or a folder.")
    return Path(text)
