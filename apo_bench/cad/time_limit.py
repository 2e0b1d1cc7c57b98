"""A limit of time for what a file asks for."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Never

from apo_bench.errors import InputError

_LIMIT_S = 20.0
_PER_TRIANGLE_S = 1e-3
_MOST_S = 120.0
"""Time of the processor that reading a file may take, and cutting each solid of it."""


class _Late(BaseException):
    """Not an `Exception`: a library that reads on after any of these must not swallow it."""


def limit_of(triangles: float) -> float:
    """How long what has so many triangles may take, [s]."""
    return min(_LIMIT_S + _PER_TRIANGLE_S * triangles, _MOST_S)


@contextmanager
def time_limit(what: str, remedy: str, limit_s: float = _LIMIT_S) -> Iterator[None]:
    """Raise an `InputError` if more time of the processor is taken. One limit may stand within another one.

    Nothing is limited outside of the main thread, nor on systems without such a clock.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGPROF, _stop)
    begin = time.process_time()
    left, _ = signal.setitimer(signal.ITIMER_PROF, limit_s)
    if left:  # within a limit that ends before this one
        signal.setitimer(signal.ITIMER_PROF, min(limit_s, left))
    try:
        yield
    except _Late:
        raise InputError(f"{what} takes more than {limit_s:.3g} s; {remedy}.") from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        if left:
            signal.setitimer(signal.ITIMER_PROF, max(left - (time.process_time() - begin), 1e-3))


def _stop(number: int, frame: FrameType | None) -> Never:
    raise _Late
