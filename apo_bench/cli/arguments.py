"""What the command line makes of the words it is given: numbers, paths, files to write."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from apo_bench.errors import InputError, require
from apo_bench.io.ordinary_files import check_target

NO_RESULT = 1
"""The exit code of a command that ended without the result it was asked for."""
Output = tuple[Path | None, str, tuple[str, ...]]
"""A file to write if any, its option, and the endings that its name may have."""
_Number = TypeVar("_Number", int, float)


def numbers(text: str, option: str) -> tuple[float, ...]:
    """`0,0.5,1` as numbers; whether they are allowed is checked where they are used."""
    return _converted(text, option, float, "numbers", "0,0.5,1")


def whole_numbers(text: str, option: str) -> tuple[int, ...]:
    """`0,2,4` as whole numbers."""
    return _converted(text, option, int, "whole numbers", "0,2,4")


def _converted(text: str, option: str, kind: type[_Number], called: str, example: str) -> tuple[_Number, ...]:
    entries = words(text, option)
    try:
        return tuple(map(kind, entries))
    except ValueError as error:
        raise InputError(
            f"{option} {text} was given; {called} with commas between them are allowed: {example}."
        ) from error


def words(text: str, option: str) -> tuple[str, ...]:
    """`oracle,none` as its entries."""
    entries = tuple(word.strip() for word in text.split(","))
    require(
        all(entries), f"{option} '{text}' was given; at least one entry is needed, with single commas between them."
    )
    return entries


def path_given(text: str) -> Path:
    """A path that names something: the empty text would stand for the current folder."""
    import typer

    if not text.strip():
        raise typer.BadParameter("an empty path was given; name a file or a folder.")
    return Path(text)


def check_outputs(outputs: Iterable[Output], inputs: Sequence[Path] = ()) -> None:
    """Refuse, before any work is done, files that cannot be written, or that are read as well."""
    for path, option, endings in outputs:
        if path is None:
            continue
        check_writable(path, option, endings)
        require(
            not any(path.exists() and source.exists() and path.samefile(source) for source in inputs),
            f"{option} {path} is a file that is read; name another, so that it is kept.",
        )


def check_writable(path: Path, option: str, endings: tuple[str, ...]) -> None:
    """Refuse, before any work is done, a file that has another ending or cannot be written."""
    allowed = " or ".join(endings)
    require(
        path.suffix.lower() in endings, f"{option} {path} was given; a file name that ends in {allowed} is allowed."
    )
    if not path.is_dir():
        check_target(path)
    folder = path.parent
    require(
        not path.is_dir() and folder.is_dir() and os.access(path if path.exists() else folder, os.W_OK),
        f"{option} {path} cannot be written; name a file in a folder that exists and can be written.",
    )


@contextmanager
def writing(target: str = "") -> Iterator[None]:
    """Say that something cannot be written, such as `--out FILE`; the file that failed if it is not named."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target or error.filename} cannot be written ({error.strerror}); choose another place."
        ) from error


def cores() -> int:
    """How many processes the machine gives this one, at most 64."""
    affinity: Any = getattr(os, "sched_getaffinity", None)
    return max(1, min(64, len(affinity(0)) if affinity else os.cpu_count() or 1))
