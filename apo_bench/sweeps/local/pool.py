"""Local processes that share the work of a sweep, or run one trial; one that dies or hangs costs one trial."""

import time
from collections.abc import Sequence
from itertools import chain
from multiprocessing import connection
from typing import Any, final

from apo_bench.records import Row, TrialSettings
from apo_bench.sweeps.local.process import Process
from apo_bench.sweeps.work.dispatch import STARTING_S, Dispatch, Job, check_limit
from apo_bench.sweeps.work.environment_lock import Check, EnvironmentLock, Unit, listening, never
from apo_bench.sweeps.work.worker import Emit, Worker
from apo_bench.trial.request import Request, checked_request, lost_request, work_on

_TURN_S = 0.5
"""How often the clock and the signals are looked at while nothing else happens."""
_MOMENT_S = 0.25
"""Between a death and its row: whoever ends all of us at once has ended this process by then."""
GOING_S = 2.0
"""What a process without work gets to end by itself."""
GRACE_S = 5.0
"""After a stop: what trials under way get to end."""
FALSE_STARTS = 3


def run_locally(
    work: Sequence[Unit],
    lock: EnvironmentLock,
    *,
    workers: int | None,
    limit_s: float,
    emit: Emit,
    check: Check = never,
) -> None:
    """Run all units on this machine, as an `Executor` does.

    A trial whose process dies, or that takes longer than `limit_s`, has a failed row; the rest of its unit goes on in
    a new process.

    Args:
        workers: Processes; None stands for this one, where no trial has a limit.
    """
    if workers is None:
        _run_here(work, lock, emit, check)
        return
    dispatch = Dispatch(work, lock, limit_s, emit, deaths=1, false_starts=FALSE_STARTS)
    members = [Member(number, lock, dispatch) for number in range(min(workers, len(work)))]
    try:
        while dispatch.waiting or any(member.job for member in members):
            check()
            for member in members:
                if member.job is None and dispatch.waiting:
                    member.begin(dispatch.waiting.popleft())
            _hear(members, dispatch, _TURN_S)
            for member in members:
                if member.job and (member.has_ended or dispatch.is_late(member.job)):
                    member.replace(check)
    except KeyboardInterrupt:
        _end_cleanly(members, dispatch)
        raise
    finally:
        for member in members:
            member.end()


def _run_here(work: Sequence[Unit], lock: EnvironmentLock, emit: Emit, check: Check) -> None:
    worker = Worker(0, lock)
    for kind, *content in chain.from_iterable(map(worker.run, work)):
        if kind == "row":
            emit(*content)
        else:
            check()
    check()


@final
class Member:
    """One of the workers: a process where there is one, and the job that it has."""

    def __init__(self, number: int, lock: EnvironmentLock, dispatch: Dispatch) -> None:
        self._number = number
        self._lock = lock
        self._dispatch = dispatch
        self.process: Process | None = None
        self.job: Job | None = None

    @property
    def has_ended(self) -> bool:
        """Whether its process has."""
        return self.process is None or self.process.exit_code is not None

    def begin(self, job: Job) -> None:
        """Have a job done, by a new process where none is there."""
        self.process = self.process or Process(_work, self._number, self._lock)
        self.job = job
        self._dispatch.given(job)
        self.process.send(job.unit)

    def hear(self) -> None:
        """Take all messages that are there."""
        while self.job and self.process and (message := self.process.receive()) is not None:
            self._dispatch.hear(self.job, message)
            if message[0] == "done":
                self.job = None

    def replace(self, check: Check) -> None:
        """End a process that is dead or too long at a trial, unless it has ended that meanwhile."""
        assert self.process is not None
        code = "worker_died" if self.has_ended else "time_limit"
        if self.has_ended:
            time.sleep(_MOMENT_S)
        check()
        self.hear()
        job = self.job
        if job is None or (code == "time_limit" and not self._dispatch.is_late(job)):
            return
        how = f"end with exit code {self.process.exit_code}" if self.has_ended else "are not ready in time"
        self.end()
        why = (
            f"worker processes {how} before they have begun a trial; use fewer of them if memory is short, and in a "
            'script of your own start sweeps under `if __name__ == "__main__":`'
        )
        self._dispatch.ended(job, code, why, {"worker": self._number})

    def end(self) -> None:
        """Send its process home; by force if it is at work or does not go."""
        if self.process is not None:
            self.process.end(0.0 if self.job else GOING_S)
        self.process = self.job = None


def _hear(members: Sequence[Member], dispatch: Dispatch, seconds: float) -> None:
    """Wait so long for messages, and take those that are there."""
    busy = [member for member in members if member.job]
    connection.wait([sign for member in busy if member.process for sign in member.process.signs], seconds)
    dispatch.tick()
    for member in busy:
        member.hear()


def _end_cleanly(members: Sequence[Member], dispatch: Dispatch) -> None:
    """After a stop: no new trials, and the rows of those that end in time."""
    for member in members:
        if member.process is not None:
            member.process.send(None)
    deadline = time.monotonic() + GRACE_S
    while (left_s := deadline - time.monotonic()) > 0.0 and any(m.job and not m.has_ended for m in members):
        _hear(members, dispatch, min(_TURN_S, left_s))


def _work(number: int, lock: EnvironmentLock, say: Any, pipe: Any) -> None:
    """The life of a worker process: unit after unit."""
    worker = Worker(number, lock)
    while (unit := pipe.recv()) is not None:
        for message in worker.run(unit, stopped=pipe.poll):
            say(*message)
        say("done")


def run_request_alone(request: Request, limit_s: float) -> Row:
    """What `run_request` does, in a process of its own that may take so much wall time.

    What it does after it has said its row, such as writing a film, has no limit.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal asked for an end.
    """
    scenario, settings = checked_request(request)
    check_limit(limit_s)
    with listening() as check:
        process = Process(_work_on_request, request, settings)
        patience_s = 0.0
        try:
            row = _row(process, limit_s, check)
            if isinstance(row, str):
                return lost_request(request, settings, scenario, row)
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


def _work_on_request(request: Request, settings: TrialSettings, say: Any, pipe: Any) -> None:
    work_on(request, settings, say)
