"""Processes below a process, how they are ended with all that they started, and what one has not written yet."""

import ctypes
import os
import signal
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

SAFE_PATH = "PYTHONSAFEPATH"
"""Without it, `python -c` looks for Python's own modules in the current folder, and so do processes of a pool."""
_ROUNDS = 100
"""What goes on starting others while it is being ended is looked for so many times."""


@contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """What processes that are started meanwhile find in their environment besides."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def descendants(pid: int) -> list[int]:
    """Children, their children and so on, those that have ended and are not waited for too; empty without /proc."""
    known = [pid]
    for process in known:  # which grows meanwhile
        known += _children(process)
    return known[1:]


def end_descendants(pid: int, spared: Collection[int] = ()) -> None:
    """Kill them all, but for the spared; whoever lost its parent and was not taken in by `pid` is not found."""
    ended = {*spared}
    for _ in range(_ROUNDS):
        alive = [process for process in descendants(pid) if process not in ended]
        if not alive:
            return
        for process in alive:
            with suppress(OSError):
                os.kill(process, signal.SIGKILL)
        ended.update(alive)


def flush() -> None:
    """Write to standard output what Python and the C library still hold back."""
    for stream in (sys.stdout, sys.__stdout__):
        if stream is not None:
            with suppress(OSError, ValueError):
                stream.flush()
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).fflush(None)


def _children(pid: int) -> list[int]:
    """The processes that a process has started, from what Linux lists for each of its threads."""
    children: list[int] = []
    with suppress(OSError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            children += map(int, (thread / "children").read_text().split())
    return children
