"""One trial in a process of its own, as sweeps run it: what ends the process or takes too long is a row too."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import connection
from typing import Any

from apo_bench.errors import InputError
from apo_bench.records.row import Row
from apo_bench.sweeps.local.member import GOING_S, STARTING_S
from apo_bench.sweeps.local.pool import check_limit
from apo_bench.sweeps.local.process import enter, kill, speaker, start
from apo_bench.sweeps.stopping import Check, listening

TURN_S = 0.1
"""How often the clock and the signals are looked at."""
Say = Callable[..., None]
"""Takes "began" when the time of the trial begins to count, and "row" with the row when it ends."""
Work = Callable[[Say], Any]


def run_alone(work: Work, limit_s: float, lost: Callable[[str], Row]) -> Row:
    """The row of a trial that may take so much wall time.

    Args:
        work: Run in the other process; what it does after it has said its row, such as writing a film, has no limit.
        lost: The row of a trial that has none, by its code: `worker_died` or `time_limit`.

    Raises:
        InputError: The request cannot be honoured.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal asked for an end.
    """
    check_limit(limit_s)
    with listening() as check:
        process, pipe = start(_work, work)
        try:
            row = _row(pipe, process, limit_s, check)
            if isinstance(row, str):
                return lost(row)
            _listen(pipe, process, None, check)
            process.join(GOING_S)
            return row
        finally:
            if process.is_alive():
                kill(process)
            process.join()
            pipe.close()


def _row(pipe: Any, process: Any, limit_s: float, check: Check) -> Row | str:
    """The row, or the code of a trial without one."""
    news = _listen(pipe, process, time.monotonic() + STARTING_S, check)
    if news is None:
        how = "is not ready in time" if process.is_alive() else f"ends with exit code {process.exitcode}"
        raise RuntimeError(f"the process of the trial {how} before it has begun; see that memory is not short.")
    began = time.monotonic()
    news = _listen(pipe, process, began + limit_s, check)
    if news is None:
        return "time_limit" if process.is_alive() else "worker_died"
    return news[1] if time.monotonic() - began <= limit_s else "time_limit"


def _listen(pipe: Any, process: Any, deadline: float | None, check: Check) -> tuple[Any, ...] | None:
    """The next thing that is said; None if the time is up, or nothing more will be said."""
    while True:
        check()
        if pipe.poll():
            try:
                return _understood(*pipe.recv())
            except (EOFError, OSError):
                return None
        if not process.is_alive() or (deadline is not None and time.monotonic() > deadline):
            return None
        connection.wait([pipe, process.sentinel], TURN_S)


def _understood(kind: str, *said: Any) -> tuple[Any, ...]:
    if kind == "refused":
        raise InputError(said[0])
    if kind == "failed":
        raise RuntimeError(f"the trial could not be run:\n{said[0]}")
    return (kind, *said)


def _work(work: Work, pipe: Any) -> None:
    """The life of the process."""
    enter()
    with suppress(OSError):
        try:
            work(speaker(pipe))
        except InputError as error:
            pipe.send(("refused", str(error)))
        except Exception:
            pipe.send(("failed", traceback.format_exc()))
        except KeyboardInterrupt:
            os._exit(1)  # signals are ignored here: it is a noise model's own, and ends its process as `sys.exit` does
