"""What the command line makes of the words it is given."""

import os
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError
from apo_bench.io.writing import check_target

NO_RESULT = 1
"""The exit code of a command that ended without the result it was asked for."""


def numbers(text: str, option: str) -> tuple[float, ...]:
    """`0,0.5,1` as numbers; whether they are allowed is checked where they are used."""
    found = words(text, option)
    try:
        return tuple(float(word) for word in found)
    except ValueError as error:
        raise InputError(
            f"{option} {text} was given; numbers with commas between them are allowed: 0,0.5,1."
        ) from error


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """`0,2,4` as whole numbers."""
    found = words(text, option)
    try:
        return tuple(int(word) for word in found)
    except ValueError as error:
        raise InputError(
            f"{option} {text} was given; whole numbers with commas between them are allowed: 0,2,4."
        ) from error


def words(text: str, option: str) -> tuple[str, ...]:
    """`oracle,none` as its entries."""
    found = tuple(word.strip() for word in text.split(","))
    if not all(found):
        raise InputError(f"{option} '{text}' was given; at least one entry is needed, with single commas between them.")
    return found


def path_given(text: str) -> Path:
    """A path that names something: the empty text would stand for the current folder."""
    import typer

    if not text.strip():
        raise typer.BadParameter("an empty path was given; name a file or a folder.")
    return Path(text)


def check_writable(path: Path, option: str, endings: tuple[str, ...]) -> None:
    """Refuse, before any work is done, a file that has another ending or cannot be written."""
    allowed = " or ".join(endings)
    if path.suffix.lower() not in endings:
        raise InputError(f"{option} {path} was given; a file name that ends in {allowed} is allowed.")
    if not path.is_dir():
        check_target(path)
    folder = path.parent
    if path.is_dir() or not folder.is_dir() or not os.access(path if path.exists() else folder, os.W_OK):
        raise InputError(f"{option} {path} cannot be written; name a file in a folder that exists and can be written.")


def cores() -> int:
    """How many processes the machine gives this one, at most 64."""
    affinity: Any = getattr(os, "sched_getaffinity", None)
    return max(1, min(64, len(affinity(0)) if affinity else os.cpu_count() or 1))
