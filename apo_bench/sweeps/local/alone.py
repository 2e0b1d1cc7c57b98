"""One trial in a process of its own, as sweeps run it: what ends the process or takes too long is a row too."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from apo_bench.records.row import Row
from apo_bench.sweeps.local.pool import GOING_S
from apo_bench.sweeps.local.process import Process
from apo_bench.sweeps.work.dispatch import STARTING_S, check_limit
from apo_bench.sweeps.work.stopping import Check, listening
from apo_bench.trial.request import Request
from apo_bench.trial.run_request import Say, checked_request, lost_request, work_on

_Work = Callable[[Say], Any]


def run_request_alone(request: Request, limit_s: float) -> Row:
    """What `run_request` does, in a process of its own that may take so much wall time.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal asked for an end.
    """
    scenario, settings = checked_request(request)
    return run_alone(partial(work_on, request, settings), limit_s, partial(lost_request, request, settings, scenario))


def run_alone(work: _Work, limit_s: float, lost: Callable[[str], Row]) -> Row:
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
        process = Process(_work, work)
        patience_s = 0.0
        try:
            row = _row(process, limit_s, check)
            if isinstance(row, str):
                return lost(row)
            process.wait(check)
            patience_s = GOING_S
            return row
        finally:
            process.end(patience_s)


def _row(process: Process, limit_s: float, check: Check) -> Row | str:
    """The row, or the code of a trial without one."""
    if process.wait(check, STARTING_S) is None:
        code = process.exit_code
        how = "is not ready in time" if code is None else f"ends with exit code {code}"
        raise RuntimeError(f"the process of the trial {how} before it has begun; see that memory is not short.")
    began = time.monotonic()
    message = process.wait(check, limit_s)
    if message is None and process.exit_code is not None:
        return "worker_died"
    return "time_limit" if message is None or time.monotonic() - began > limit_s else message[1]


def _work(work: _Work, say: Say, pipe: Any) -> None:
    work(say)
