"""What passes between a sweep and its workers, whichever executor it has: units of work, messages, the wish to stop.

Messages are tuples whose first item is a word:

("began",)              a trial begins; its scene is compiled and its corrector imported, so its time counts now
("row", row, timing)    it has ended
("done",)               the unit of work has ended
("refused", sentence)   the request cannot be honoured; nothing follows
("failed", text)        a trial could not be run; nothing follows
"""

import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.records import TrialSettings

Message = tuple[Any, ...]


@final
@dataclass(frozen=True)
class Unit:
    """Trials of one scenario, clearance, seed, carelessness and eye: they share layout and demonstration."""

    trials: tuple[TrialSettings, ...]


def last_message(error: Exception) -> Message:
    """What a worker says that cannot go on."""
    if isinstance(error, InputError):
        return "refused", str(error)
    return "failed", f"a trial could not be run:\n{''.join(traceback.format_exception(error))}"


def checked(message: Message) -> Message:
    """The message, unless it is one after which nothing follows.

    Raises:
        InputError: The request cannot be honoured.
        RuntimeError: A trial could not be run.
    """
    kind, *content = message
    if kind == "refused":
        raise InputError(*content)
    if kind == "failed":
        raise RuntimeError(*content)
    return message


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
    before: dict[int, Any] = {number: found for number in ours if (found := signal.getsignal(number)) in usual}
    for number in before:
        signal.signal(number, note)
    try:
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
