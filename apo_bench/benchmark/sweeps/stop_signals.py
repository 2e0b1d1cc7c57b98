"""Convert signals that end a program into exceptions, as Ctrl-C is."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, final

Check = Callable[[], None]
"""Raises `StoppedBySignal` if a signal has arrived."""
# where there is no SIGHUP, SIGTERM stands twice
_SIGNALS = (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
_USUAL = (signal.SIG_DFL, signal.default_int_handler)  # handlers that may be replaced


@final
class StoppedBySignal(KeyboardInterrupt):
    """A signal asked this process to stop; `number` is that of the signal."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def stop_at_signals(patience: int = 0) -> Iterator[Check]:
    """Raise `StoppedBySignal` when a signal arrives; signals that the caller handles or ignores are left alone.

    Args:
        patience: Number of signals that raise nothing at once; the yielded function raises `StoppedBySignal` after any
            of them.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        if len(came) > patience:
            raise StoppedBySignal(number)

    def check() -> None:
        if came:
            raise StoppedBySignal(came[0])

    # only the main thread may set handlers
    signals = _SIGNALS if threading.current_thread() is threading.main_thread() else ()
    before: dict[int, Any] = {number: found for number in signals if (found := signal.getsignal(number)) in _USUAL}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    except KeyboardInterrupt as error:
        # Ray raises a plain KeyboardInterrupt
        raise StoppedBySignal(came[0] if came else signal.SIGINT) from error
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
