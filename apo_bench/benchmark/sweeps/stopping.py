"""Signals that ask a program to end raise an exception, as Ctrl-C does."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, final

Check = Callable[[], None]
"""Raises `Stopped` once a signal came."""
_SIGNALS = (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))


@final
class Stopped(KeyboardInterrupt):
    """A signal asked this process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def stoppable() -> Iterator[None]:
    """SIGTERM and SIGHUP raise `Stopped` meanwhile; those that the caller handles or ignores stay as they are."""
    came: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        came.append(number)
        raise Stopped(number)

    in_main = threading.current_thread() is threading.main_thread()
    ours = []
    for number in {signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}:
        if in_main and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, stop)
            ours.append(number)
    try:
        yield
    except KeyboardInterrupt as error:
        raise Stopped(came[0] if came else signal.SIGINT) from error  # Ray makes a plain one of any
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def listening() -> Iterator[Check]:
    """Take note of signals that ask for an end; what is yielded raises `Stopped` once one came.

    A second signal raises at once, wherever the program is. Signals that were ignored or had a handler of the caller's
    own before stay as they are, and so do all of them outside the main thread.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        if len(came) > 1:
            raise Stopped(number)

    def check() -> None:
        if came:
            raise Stopped(came[0])

    ours = _SIGNALS if threading.current_thread() is threading.main_thread() else ()
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before: dict[int, Any] = {number: found for number in ours if (found := signal.getsignal(number)) in usual}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
