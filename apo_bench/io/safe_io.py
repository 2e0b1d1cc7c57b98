"""Read ordinary files up to a size limit."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from apo_bench.errors import InputError, add_article, require

LARGEST_BYTES = 1_000_000


_BUFFER = 1 << 20  # bytes that are read at a time


@contextmanager
def open_file(path: str | Path, kind: str) -> Iterator[BinaryIO]:
    """Open an ordinary file, or a link to one, for reading.

    Args:
        kind: What the file should be, for the message: `sweep file`.

    Raises:
        InputError: There is no such file, it is no ordinary one, or reading fails, also within the block.
    """
    try:
        mode = os.stat(path).st_mode
    except ValueError as error:
        raise InputError(f"{str(path)!r}: this is not a path ({error}); give the path of a {kind}.") from error
    except OSError as error:
        raise _unreadable_error(path, kind, error) from error
    require(stat.S_ISREG(mode), f"{path}: {kind_of(mode)} was given; give {add_article(kind)}.")
    try:
        with open(path, "rb", _BUFFER) as file:
            yield file
    except OSError as error:
        raise _unreadable_error(path, kind, error) from error


def _unreadable_error(path: str | Path, kind: str, error: OSError) -> InputError:
    return InputError(f"{path}: the {kind} cannot be read ({error.strerror or error}); check the path.")


def read_bytes(path: str | Path, kind: str, limit: int = LARGEST_BYTES) -> bytes:
    """Return the content of a file.

    Raises:
        InputError: It is no ordinary file, cannot be opened, or is larger than the limit.
    """
    with open_file(path, kind) as file:
        content = file.read(limit + 1)  # one byte more than allowed, to detect more
    require(len(content) <= limit, f"{path}: the file is larger than {limit / 1e6:g} MB; give {add_article(kind)}.")
    return content


def read_text(path: str | Path, kind: str, limit: int = LARGEST_BYTES) -> str:
    """Return the text of a file, without a byte order mark.

    Raises:
        InputError: It cannot be read, is larger than the limit, or is not UTF-8.
    """
    return decode_text(read_bytes(path, kind, limit), str(path), kind)


def read_lines(path: str | Path, kind: str) -> Iterator[tuple[int, bytes]]:
    """Yield number, from 1, and content of each line; an incomplete last line, without an end, is left out.

    Raises:
        InputError: It is no ordinary file, or cannot be read.
    """
    with open_file(path, kind) as file:
        yield from ((number, line) for number, line in enumerate(file, start=1) if line.endswith(b"\n"))


def decode_text(raw: bytes, file: str, kind: str) -> str:
    """Decode bytes as UTF-8, without a byte order mark; `file` is their name in messages."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{file}: the file is not UTF-8 text (byte {error.start}); save the {kind} as UTF-8."
        ) from error


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
    """Return the kind of a mode of `os.stat` in words: `a folder`."""
    return next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")
