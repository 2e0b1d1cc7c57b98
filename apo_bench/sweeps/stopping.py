"""Signals that ask a program to end raise an exception, as Ctrl-C does."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import final


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
