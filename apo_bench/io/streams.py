"""Standard streams that may be closed, full or redirected, and a current folder that may be gone."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path


def flush() -> None:
    """Write to standard output what Python and the C library still hold back."""
    for stream in (sys.stdout, sys.__stdout__):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).fflush(None)


class Unusable(Exception):
    """Nothing can be printed, or no path be found: one sentence."""


def prepare() -> str:
    """The current folder; standard input and error, if they are closed, lead nowhere.

    Nothing may be opened before: it would take the number of a closed stream, and be printed into.

    Raises:
        Unusable: Standard output is closed, or the current folder was deleted.
    """
    if sys.stderr is None:
        _lead_nowhere(2)
        sys.stderr = os.fdopen(2, "w", errors="backslashreplace", closefd=False)
    if sys.stdin is None:
        _lead_nowhere(0)
        sys.stdin = os.fdopen(0, closefd=False)
    if sys.stdout is None:
        raise Unusable("standard output is closed; send it to a file, or to /dev/null.")
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        return str(Path.cwd())
    except OSError as error:
        raise Unusable(
            f"the current folder cannot be found ({error.strerror}); change into one that exists."
        ) from error


def finish() -> None:
    """Print what is held back.

    Raises:
        OSError: Standard output is full, or nobody reads it any more.
    """
    if sys.stdout is not None:
        sys.stdout.flush()


def give_up(error: OSError) -> str:
    """What is to be said when something could not be written; what standard output holds back is thrown away."""
    if error.filename is not None:
        return f"{error.filename}: {error.strerror}."
    with suppress(OSError, ValueError, AttributeError):
        if not isinstance(error, BrokenPipeError):
            sys.stdout.flush()
            return f"a file could not be read or written ({error.strerror or error}); is there room on the disk?"
    with suppress(OSError, ValueError):
        _lead_nowhere(1)
    sys.stdout = sys.__stdout__
    return f"standard output could not be written ({error.strerror or error}); what was not printed is lost."


@contextmanager
def redirect_output(wanted: bool) -> Iterator[None]:
    """If wanted, what is printed meanwhile, by whatever code and below Python too, goes to standard error.

    Standard output is then left to one JSON object.
    """
    if not wanted:
        yield
        return
    flush()
    try:
        ours = os.dup(1)
    except OSError:
        ours = None
    try:
        if ours is not None:
            with suppress(OSError):
                os.dup2(2, 1)
        with redirect_stdout(sys.stderr):
            yield
    finally:
        flush()
        if ours is not None:
            os.dup2(ours, 1)
            os.close(ours)


def _lead_nowhere(number: int) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere != number:
        os.dup2(nowhere, number)
        os.close(nowhere)
