"""Files are read here: ordinary ones only, none larger than allowed, text in UTF-8; nothing else is waited for."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from apo_bench.errors import InputError, require

LARGEST_BYTES = 1_000_000
_LONGEST_LINE = 1 << 20
"""Bytes; ten times the longest line that a sweep writes."""
_FLAGS = ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY")


@contextmanager
def opened(path: str | Path, kind: str) -> Iterator[BinaryIO]:
    """An ordinary file, or a link to one, to read from; nothing else is waited for.

    Args:
        kind: What the file should be, for the message: `sweep file`.

    Raises:
        InputError: There is no such file, it is no ordinary one, or it cannot be read, also while it is open.
    """
    try:
        _check_ordinary(path, kind, os.stat(path).st_mode)
        number = os.open(path, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in _FLAGS))
        with os.fdopen(number, "rb") as file:
            _check_ordinary(path, kind, os.fstat(number).st_mode)
            yield file
    except OSError as error:
        raise InputError(f"{path}: the {kind} cannot be read ({error.strerror or error}); check the path.") from error
    except ValueError as error:
        if isinstance(error, InputError) or not _is_no_path(path):
            raise
        raise InputError(f"{str(path)!r}: this is not a path ({error}); give the path of a {kind}.") from error


def read_bytes(path: str | Path, kind: str, limit: int = LARGEST_BYTES, *, own: bool = False) -> bytes:
    """What stands in a file.

    Args:
        own: Whether it must belong to this user, where the system tells users apart.

    Raises:
        InputError: It is no ordinary file, cannot be opened, is larger than the limit, or belongs to another user.
    """
    with opened(path, kind) as file:
        require(
            not (own and hasattr(os, "geteuid") and os.fstat(file.fileno()).st_uid != os.geteuid()),
            f"{path}: the {kind} belongs to another user.",
        )
        content = file.read(limit + 1)
    require(len(content) <= limit, f"{path}: the file is larger than {limit / 1e6:g} MB; give a {kind}.")
    return content


def read_text(path: str | Path, kind: str, limit: int = LARGEST_BYTES, *, own: bool = False) -> str:
    """The text of a file, without a byte order mark.

    Args:
        own: As in `read_bytes`.

    Raises:
        InputError: It cannot be read, is larger than the limit, belongs to another user, or is not UTF-8.
    """
    return decoded(read_bytes(path, kind, limit, own=own), str(path), kind)


def each_line(path: str | Path, kind: str) -> Iterator[tuple[int, bytes]]:
    """The lines of a file, numbered from 1; a last one without an end, torn as it was written, is left out.

    Raises:
        InputError: It is no ordinary file, cannot be opened, or has a line longer than any that is written.
    """
    with opened(path, kind) as file:
        number = 0
        while line := file.readline(_LONGEST_LINE + 1):
            number += 1
            require(
                len(line) <= _LONGEST_LINE,
                f"{path}, line {number}: at most {_LONGEST_LINE:,} bytes are allowed in a line; remove it.",
            )
            if line.endswith(b"\n"):
                yield number, line


def decoded(raw: bytes, file: str, kind: str) -> str:
    """The text in bytes, without a byte order mark; `file` is their name in messages."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{file}: the file is not UTF-8 text (byte {error.start}); save the {kind} as UTF-8."
        ) from error


def _check_ordinary(path: str | Path, kind: str, mode: int) -> None:
    require(stat.S_ISREG(mode), f"{path}: {kind_of(mode)} was given; give a {kind}.")


def _is_no_path(path: str | Path) -> bool:
    """Whether the system cannot even look for it: a zero byte in it, or half of a letter."""
    try:
        os.fsencode(path)
    except ValueError:
        return True
    return "\0" in str(path)


_KINDS = (
    (stat.S_ISLNK, "a symbolic link"),
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISREG, "a file"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def kind_of(mode: int) -> str:
    """What a mode of `os.stat` is of, in words: `a folder`."""
    return next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
