"""Signals that end a program raise an exception, as Ctrl-C does."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, final

Check = Callable[[], None]
"""Raises `Stopped` once a signal came."""
_SIGNALS = (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM))
_USUAL = (signal.SIG_DFL, signal.default_int_handler)


@final
class Stopped(KeyboardInterrupt):
    """A signal asked this process to stop."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def stop_at_signals(patience: int = 0) -> Iterator[Check]:
    """Raise `Stopped` at signals, wherever the program is; signals that the caller handles or ignores stay as they are.

    Args:
        patience: Signals that are only noted; the yielded function raises `Stopped` once there is one.
    """
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        if len(came) > patience:
            raise Stopped(number)

    def check() -> None:
        if came:
            raise Stopped(came[0])

    signals = _SIGNALS if threading.current_thread() is threading.main_thread() else ()
    before: dict[int, Any] = {number: found for number in signals if (found := signal.getsignal(number)) in _USUAL}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    except KeyboardInterrupt as error:
        raise Stopped(came[0] if came else signal.SIGINT) from error  # Ray raises a plain one
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
