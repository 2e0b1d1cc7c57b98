"""Ctrl-C and its kin: the first asks for a clean end, the second ends at once."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, final

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
Check = Callable[[], None]
"""Raises `Stopped` if this process was asked to stop; to be called where stopping is clean."""


@final
class Stopped(KeyboardInterrupt):
    """A signal asked this process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


def never() -> None:
    """Nobody asks."""


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

    ours = SIGNALS if threading.current_thread() is threading.main_thread() else ()
    usual = (signal.SIG_DFL, signal.default_int_handler)
    before: dict[int, Any] = {number: signal.getsignal(number) for number in ours}
    before = {number: handler for number, handler in before.items() if handler in usual}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
