"""What is printed where: one JSON object on standard output, and nothing else."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress

from apo_bench.io.processes import flush


@contextmanager
def redirect_output(asked: bool) -> Iterator[None]:
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
