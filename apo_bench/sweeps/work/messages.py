"""What a worker is given, and what it says while it works, whichever executor it has.

Messages are tuples whose first item is a word:

("began",)              a trial begins; its scene is compiled and its corrector imported, so its time counts now
("row", row, timing)    it has ended
("done",)               the unit of work has ended
("refused", sentence)   the request cannot be honoured; nothing follows
("failed", text)        a trial could not be run; nothing follows
"""

import traceback
from dataclasses import dataclass
from typing import Any, final

from apo_bench.errors import InputError
from apo_bench.records.settings import TrialSettings

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
