"""Prepare, flush and redirect the standard streams of a command."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path


class Unusable(Exception):
    """The program cannot print, or has no current folder; the message is one sentence."""


def prepare_streams() -> str:
    """Make the standard streams accept any text, and return the current folder.

    Raises:
        Unusable: Standard output is closed, or the current folder was deleted.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    if sys.stdout is None:
        raise Unusable("standard output is closed; send it to a file, or to /dev/null.")
    try:
        return str(Path.cwd())
    except OSError as error:
        raise Unusable(
            f"the current folder cannot be found ({error.strerror}); change into one that exists."
        ) from error


def flush_and_finish() -> None:
    """Flush standard output; a pipe that its reader has closed is no error.

    Raises:
        Unusable: Writing failed, as on a full disk.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        discard_output()
    except OSError as error:
        discard_output()
        raise Unusable(
            f"standard output could not be written ({error.strerror}); what was not printed is lost."
        ) from error


def discard_output() -> None:
    """Discard all further output, so that nothing fails at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def describe_unexpected_error(error: OSError) -> str:
    """Return the sentence about a file error that the program does not expect at that place."""
    if error.filename is not None:
        return f"{error.filename}: {error.strerror}."
    return f"a file could not be read or written ({error.strerror or error}); is there room on the disk?"


def flush() -> None:
    """Flush the buffers of Python and of the C library for standard output."""
    for stream in (sys.stdout, sys.__stdout__):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).fflush(None)


@contextmanager
def redirect_output(wanted: bool) -> Iterator[None]:
    """If `wanted`, send everything printed within the block to standard error, also from below Python.

    Standard output is then free for one JSON object.
    """
    if not wanted:
        yield
        return
    flush()
    ours = os.dup(1)
    try:
        os.dup2(2, 1)
        with redirect_stdout(sys.stderr):
            yield
    finally:
        flush()
        os.dup2(ours, 1)
        os.close(ours)
