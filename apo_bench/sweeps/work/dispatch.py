"""Which trials of a sweep wait, which are under way, and what becomes of one whose worker ends: on every executor."""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, final

from apo_bench.errors import require
from apo_bench.records import TrialSettings
from apo_bench.sweeps.work.environment_lock import Check, EnvironmentLock, Message, Unit, checked
from apo_bench.sweeps.work.worker import Emit, timing
from apo_bench.trial.outcome_columns import lost

STARTING_S = 300.0
"""What a worker gets to be ready, and to compile a scene."""
_LONGEST_TURN_S = 2.0
"""What lies between two looks at the clock beyond this does not count: this process was asleep."""
_LONGEST_TRIAL_S = 1e6


def check_limit(limit_s: float) -> None:
    """Raise an `InputError` unless a trial can have such a limit."""
    require(
        math.isfinite(limit_s) and 0.0 < limit_s <= _LONGEST_TRIAL_S,
        f"a limit of {limit_s:g} s per trial was given; a number above 0 and up to {_LONGEST_TRIAL_S:g} is allowed.",
    )


class Executor(Protocol):
    """Runs all units and emits one row per trial, in the order in which trials end; `local` and `ray` have one each."""

    def __call__(
        self,
        work: Sequence[Unit],
        lock: EnvironmentLock,
        *,
        workers: int | None,
        limit_s: float,
        emit: Emit,
        check: Check,
    ) -> None:
        """Run them.

        Args:
            workers: At most so many at a time.
            limit_s: Wall time that a trial may take; one that takes longer has a failed row.
            check: Asked now and then; when it raises `Stopped`, the trials under way get a moment to end.

        Raises:
            InputError: A worker found that the request cannot be honoured.
            RuntimeError: A trial could not be run at all, or workers end before they have begun one.
            Stopped: Passed on after the rows of the trials that had ended were emitted.
        """


@final
@dataclass(eq=False)
class Job:
    """A unit of work, and how far it is."""

    trials: list[TrialSettings]
    """The trials without a row; the first may be under way."""
    since: float | None = None
    """When the trial under way began; None where none is."""
    heard: float = math.inf
    """When its worker was given it, or last said something; infinite where no worker has it."""
    deaths: int = 0
    """How many workers in a row have died of its first trial."""
    false_starts: int = 0
    """How many workers in a row have ended before its first trial began."""

    @property
    def unit(self) -> Unit:
        """What a worker is given."""
        return Unit(tuple(self.trials))


@final
class Dispatch:
    """Hands out jobs, and emits one row per trial, in the order in which trials end."""

    def __init__(
        self,
        work: Sequence[Unit],
        lock: EnvironmentLock,
        limit_s: float,
        emit: Emit,
        *,
        deaths: int,
        false_starts: int,
    ) -> None:
        """Args:
        limit_s: Wall time that a trial may take.
        deaths: So many workers in a row die of a trial before it is lost.
        false_starts: So many workers in a row end before a trial begins until that is given up.
        """
        self.waiting = deque(Job(list(unit.trials)) for unit in work)
        self._lock = lock
        self._limit_s = limit_s
        self._emit = emit
        self._deaths = deaths
        self._false_starts = false_starts
        self._has_begun = False
        """Whether a worker of this sweep has begun a trial."""
        self._now = 0.0
        self._looked = time.monotonic()

    def tick(self) -> None:
        """Look at the clock, which stands still while this process does."""
        now = time.monotonic()
        self._now += min(now - self._looked, _LONGEST_TURN_S)
        self._looked = now

    def given(self, job: Job) -> None:
        """A worker has the job: from now on it has a limit."""
        job.heard = self._now

    def hear(self, job: Job, message: Message) -> None:
        """Act on what the worker of a job says.

        Raises:
            InputError: The request cannot be honoured.
            RuntimeError: A trial could not be run.
        """
        kind, *content = checked(message)
        job.heard = self._now
        if kind == "began":
            job.since = self._now
            job.false_starts = 0
            self._has_begun = True
        elif kind == "row":
            del job.trials[0]
            job.since = None
            job.deaths = job.false_starts = 0
            self._emit(*content)

    def is_late(self, job: Job) -> bool:
        """Whether the time of its trial is up, or that in which one should have begun."""
        if job.since is not None:
            return self._now - job.since > self._limit_s
        return self._now - job.heard > STARTING_S

    def ended(self, job: Job, code: str | None, why: str, worker: Mapping[str, Any]) -> None:
        """The worker of a job is gone: the trial under way is lost if that was its own doing, and the rest waits.

        Args:
            code: `worker_died` or `time_limit`; None where the trial has no part in it, as where a node is lost.
            why: What to say if workers end too often before they have begun a trial.
            worker: What `timing.jsonl` says of the worker.

        Raises:
            RuntimeError: They do, and it is not the doing of a corrector of one's own.
        """
        if job.trials and code is not None and self._is_lost(job, code, why):
            spec = job.trials.pop(0)
            took_s = None if job.since is None else self._now - job.since
            row = lost(spec, self._lock.content[spec.scenario], code)
            self._emit(row, timing(row, None, None, took_s, worker))
            job.deaths = job.false_starts = 0
        job.since = None
        job.heard = math.inf
        if job.trials:
            self.waiting.appendleft(job)

    def _is_lost(self, job: Job, code: str, why: str) -> bool:
        if job.since is not None:
            job.deaths += 1
            return code == "time_limit" or job.deaths >= self._deaths
        job.false_starts += 1
        if job.false_starts < self._false_starts:
            return False
        if self._has_begun and ":" in job.trials[0].method:
            return True
        raise RuntimeError(why)
