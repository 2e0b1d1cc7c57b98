"""Standard streams that may be closed, full or redirected, and a current folder that may be gone."""

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any


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

    Nothing may be opened before: it would take the number of a closed stream, and be printed into. From here on a pipe
    that nobody reads any more, or a full disk behind standard output, does not end the program: results come first, and
    `finish` reports what was not printed.

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
    sys.stdout = _patient(sys.stdout)
    sys.stderr = _patient(sys.stderr)
    try:
        return str(Path.cwd())
    except OSError as error:
        raise Unusable(
            f"the current folder cannot be found ({error.strerror}); change into one that exists."
        ) from error


def finish() -> None:
    """Print what is held back.

    Raises:
        Unusable: Something could not be printed, such as on a full disk; a closed pipe is no error.
    """
    sys.stdout.flush()
    raw = _raw(sys.stdout)
    error = raw.error if isinstance(raw, _PatientFile) else None
    if error is not None and not isinstance(error, BrokenPipeError):
        raise Unusable(f"standard output could not be written ({error.strerror}); what was not printed is lost.")


def unexpected(error: OSError) -> str:
    """The sentence for a file that could not be read or written where the program does not expect it."""
    if error.filename is not None:
        return f"{error.filename}: {error.strerror}."
    return f"a file could not be read or written ({error.strerror or error}); is there room on the disk?"


class _PatientFile(io.FileIO):
    """A standard stream that keeps its first error, and throws away what cannot be written from then on."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        if self.error is None:
            try:
                return super().write(data)
            except OSError as error:
                self.error = error
        return memoryview(data).nbytes


def _raw(stream: Any) -> Any:
    """What a text stream writes its bytes to at last."""
    buffer = getattr(stream, "buffer", None)
    return getattr(buffer, "raw", buffer)


def _patient(stream: Any) -> Any:
    """The same stream on a `_PatientFile`, if it is a standard one on a plain file descriptor."""
    if stream not in (sys.__stdout__, sys.__stderr__) or type(_raw(stream)) is not io.FileIO:
        return stream
    stream.flush()
    raw: Any = _PatientFile(stream.fileno(), "wb", closefd=False)
    return io.TextIOWrapper(
        raw if stream.write_through else io.BufferedWriter(raw),
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


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
