"""Local processes that share the work of a sweep; one that dies or hangs costs one trial, and is replaced."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Sequence
from multiprocessing import connection

from apo_bench.errors import InputError
from apo_bench.records.method import is_own
from apo_bench.sweeps.environment_lock import EnvironmentLock
from apo_bench.sweeps.grid import Unit
from apo_bench.sweeps.local.member import Member
from apo_bench.sweeps.stopping import Check, never
from apo_bench.sweeps.worker import Emit, lost, timing

TURN_S = 0.5
"""How often the clock and the signals are looked at while nothing else happens."""
MOMENT_S = 0.25
"""Between a death and its row: whoever ends all of us at once has ended this process by then."""
GRACE_S = 5.0
"""After a stop: what trials under way get to end."""
MOST_FALSE_STARTS = 3
LONGEST_TRIAL_S = 1e6


def check_limit(limit_s: float) -> None:
    """Raise an `InputError` unless a trial can have such a limit."""
    if not (math.isfinite(limit_s) and 0.0 < limit_s <= LONGEST_TRIAL_S):
        raise InputError(
            f"a limit of {limit_s:g} s per trial was given; a number above 0 and up to {LONGEST_TRIAL_S:g} is allowed."
        )


def spread(
    work: Sequence[Unit], lock: EnvironmentLock, *, workers: int, limit_s: float, emit: Emit, check: Check = never
) -> None:
    """Run all units in `workers` processes and emit one row per trial, in the order in which trials end.

    A trial whose process dies, or that takes longer than `limit_s`, has a failed row; the rest of its unit goes on in
    a new process.

    Args:
        check: Asked now and then; when it raises `Stopped`, the trials under way get a moment to end.

    Raises:
        InputError: A worker found that the request cannot be honoured.
        RuntimeError: A trial could not be run at all, or processes end before they have begun one.
        Stopped: Passed on after the rows of the trials that had ended were emitted.
    """
    waiting = deque(work)
    crew = [Member(number, lock) for number in range(min(workers, len(work)))]
    try:
        while waiting or any(member.unit for member in crew):
            check()
            for member in crew:
                if member.unit is None and waiting:
                    member.give(waiting.popleft())
            _hear(crew, emit)
            for member in crew:
                if member.unit is not None and (not member.process.is_alive() or member.overdue(limit_s)):
                    _replace(member, limit_s, waiting, emit, check, any(one.has_begun for one in crew))
    except KeyboardInterrupt:
        _end_cleanly(crew, emit)
        raise
    finally:
        for member in crew:
            member.end()


def _hear(crew: Sequence[Member], emit: Emit) -> None:
    """Wait a turn for messages, and take those that are there."""
    busy = [member for member in crew if member.unit is not None]
    connection.wait([sign for member in busy for sign in (member.pipe, member.process.sentinel)], TURN_S)
    for member in busy:
        while member.unit is not None and member.hear(emit):
            pass


def _replace(
    member: Member, limit_s: float, waiting: deque[Unit], emit: Emit, check: Check, begun_before: bool
) -> None:
    """End a process that is dead or too long at a trial: that trial is lost, the rest of its unit waits.

    Args:
        begun_before: Whether a process of this sweep has begun a trial.
    """
    code = "time_limit" if member.process.is_alive() else "worker_died"
    if code == "worker_died":
        time.sleep(MOMENT_S)
    check()
    while member.unit is not None and member.hear(emit):
        pass
    if member.unit is None or (code == "time_limit" and not member.overdue(limit_s)):
        return
    unit, done, since = member.unit, member.done, member.since
    spec = unit.trials[done] if unit.trials[done:] else None
    given_up = since is None and _gives_up(member, code, begun_before and spec is not None and is_own(spec.method))
    member.end()
    if spec is not None and (since is not None or given_up):
        row = lost(spec, member.lock.content[spec.scenario], code)
        emit(row, timing(row, member.number, None, None, None if since is None else time.monotonic() - since))
        done += 1
    if unit.trials[done:]:
        waiting.appendleft(Unit(unit.trials[done:]))


def _gives_up(member: Member, code: str, correctors_doing: bool) -> bool:
    """Whether a process has ended too often before a trial began; if that is the corrector's doing, the trial is lost.

    Args:
        correctors_doing: Processes have begun trials before, and this one has a corrector of one's own.

    Raises:
        RuntimeError: It is not.
    """
    member.false_starts += 1
    if member.false_starts < MOST_FALSE_STARTS:
        return False
    if correctors_doing:
        member.false_starts = 0
        return True
    how = "are not ready in time" if code == "time_limit" else f"end with exit code {member.process.exitcode}"
    raise RuntimeError(
        f"worker processes {how} before they have begun a trial; use fewer of them if memory is short, and in a script "
        'of your own start sweeps under `if __name__ == "__main__":`'
    )


def _end_cleanly(crew: Sequence[Member], emit: Emit) -> None:
    """After a stop: no new trials, and the rows of those that end in time."""
    for member in crew:
        if member.unit is not None:
            member.stop()
    deadline = time.monotonic() + GRACE_S
    while time.monotonic() < deadline and (busy := [m for m in crew if m.unit is not None and m.process.is_alive()]):
        _hear(busy, emit)
