"""Write result files, completely or not at all.

A write that fails leaves the old file unchanged, and nothing is written through a symbolic link. The only exception are
the records of a sweep, which are appended line by line (`open_to_append`).
"""

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from apo_bench.errors import InputError
from apo_bench.io.safe_io import kind_of


@contextmanager
def replace_file(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that replaces `path` at the end of the block, unless the block fails.

    The new file has the permissions of the old one.

    Raises:
        InputError: `path` is a link or no ordinary file, or cannot be written.
    """
    path = Path(path)
    check_target(path)
    part = path.with_name(f".{secrets.token_hex(8)}.part")
    before = _get_file_mode(path)
    try:
        if before is not None and not os.access(path, os.W_OK):
            raise PermissionError("permission denied")
        with part.open("x+b") as file:
            if before is not None:
                part.chmod(stat.S_IMODE(before))
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        # an error of the block itself
        if isinstance(error, BrokenPipeError) or error.filename not in (None, str(part), str(path)):
            raise
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place.") from error
    finally:
        with suppress(OSError):
            part.unlink()  # exists only after a failure


def write_file(path: str | Path, content: str | bytes) -> None:
    """Write a file completely or not at all; text is encoded as UTF-8.

    Raises:
        InputError: As `replace_file`.
    """
    with replace_file(path) as file:
        file.write(content.encode("utf-8", "replace") if isinstance(content, str) else content)


def open_to_append(path: Path) -> IO[bytes]:
    """Open an ordinary file for reading and appending, unbuffered; make it if it does not exist.

    Raises:
        InputError: `path` is a link or no ordinary file.
        OSError: The file cannot be opened.
    """
    check_target(path)
    return path.open("a+b", buffering=0)


def check_target(path: Path) -> None:
    """Raise an `InputError` if a path to be written exists and is no ordinary file."""
    mode = _get_file_mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise InputError(f"{path} is {kind_of(mode)}, and only an ordinary file is written over; remove it.")


def _get_file_mode(path: Path) -> int | None:
    """Return the mode at a path, without following links; None if nothing exists there."""
    try:
        return os.lstat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
