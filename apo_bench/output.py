"""What is printed where: one JSON object on standard output, and nothing else."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress


@contextmanager
def aside(asked: bool) -> Iterator[None]:
    """If asked, what is printed meanwhile, by whatever code and below Python too, goes to standard error."""
    if not asked:
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


def flush() -> None:
    """Write what Python and the C library still hold back."""
    for stream in (sys.stdout, sys.__stdout__):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).fflush(None)
