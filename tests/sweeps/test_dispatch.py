"""Who is late: a trial has its limit from the moment it begins, a worker that is getting ready has a longer one."""

from __future__ import annotations

import pytest

from apo_bench import TrialSettings
from apo_bench.sweeps.work import dispatch
from apo_bench.sweeps.work.dispatch import STARTING_S, Dispatch, Job
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Unit, versions
from apo_bench.sweeps.work.worker import row_within_limit, timing
from apo_bench.trial.outcome_columns import lost, misbehaved

LIMIT_S = 10.0
TRIAL = TrialSettings("block_on_block", method="none")


class Clock:
    """Time that passes when it is told to, in turns too short to be sleep."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def passes(self, watch: Dispatch, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now = min(self.now + 1.0, end)
            watch.tick()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(dispatch, "time", found)
    return found


@pytest.fixture
def watch(clock: Clock) -> Dispatch:
    lock = EnvironmentLock({}, versions())
    return Dispatch([Unit((TRIAL,))], lock, LIMIT_S, lambda row, timing: None, deaths=1, false_starts=3)


def test_a_worker_that_is_getting_ready_has_longer_than_a_trial(watch: Dispatch, clock: Clock) -> None:
    job: Job = watch.waiting.popleft()
    clock.passes(watch, 2 * STARTING_S)
    assert not watch.is_late(job)
    watch.given(job)
    clock.passes(watch, STARTING_S - 1.0)
    assert not watch.is_late(job)
    clock.passes(watch, 2.0)
    assert watch.is_late(job)


def test_a_trial_is_late_after_its_limit_and_the_next_one_begins_anew(watch: Dispatch, clock: Clock) -> None:
    job = watch.waiting.popleft()
    watch.given(job)
    clock.passes(watch, 5 * LIMIT_S)
    watch.hear(job, ("began",))
    clock.passes(watch, LIMIT_S - 1.0)
    assert not watch.is_late(job)
    clock.passes(watch, 2.0)
    assert watch.is_late(job)
    watch.hear(job, ("row", {}, {}))
    assert not watch.is_late(job)


def test_what_a_late_row_says() -> None:
    """One that tells of a lost worker says why already; every other one becomes a trial that took too long."""
    died = lost(TRIAL, "", "worker_died")
    raised = misbehaved(TRIAL, "", "ok", "it raised")
    took = {name: timing(row, 0.1, 4.0, 7.0, {}) for name, row in (("died", died), ("raised", raised))}
    assert row_within_limit(raised, took["raised"], 11.0) is raised
    assert row_within_limit(raised, took["raised"], 10.9) == lost(TRIAL, "", "time_limit")
    assert row_within_limit(died, took["died"], 10.9) is died
