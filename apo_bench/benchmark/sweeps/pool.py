"""Local processes that share the batches of a sweep.

A batch whose process dies, or that takes longer than a trial may, runs again trial by trial: so the one that is to
blame has the failed record.
"""

import math
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from pebble import ProcessExpired, ProcessPool

from apo_bench.benchmark.sweeps.grid import Batch
from apo_bench.benchmark.sweeps.stopping import stop_at_signals
from apo_bench.benchmark.sweeps.worker import Ended, SweepInputs, Timing, Worker, timing
from apo_bench.errors import require
from apo_bench.io import SAFE_PATH, set_environment
from apo_bench.names import add_own_modules, folder_of_own_modules
from apo_bench.records import TrialRecord
from apo_bench.trial.endings import record_lost_trial
from apo_bench.trial.request import Request, checked_request, record_lost_request, run_request

Emit = Callable[[TrialRecord, Timing], None]
"""Takes the record of a trial that has ended; every trial of a sweep yields exactly one."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Workers have one thread per linear algebra library: the processes already fill the cores."""
_MOST_BATCHES = 200
"""After so many a process is replaced, which gives its memory back."""
_AHEAD = 2
"""So many batches for each process are handed out: one is done, the others wait."""
_LONGEST_TRIAL_S = 1e6
_WORKERS: list[Worker] = []
"""In a process of a pool: its worker, once it has one."""


def check_limit(limit_s: float) -> None:
    """Raise an `InputError` unless a trial can have such a limit."""
    require(
        math.isfinite(limit_s) and 0.0 < limit_s <= _LONGEST_TRIAL_S,
        f"a limit of {limit_s:g} s per trial was given; a number above 0 and up to {_LONGEST_TRIAL_S:g} is allowed.",
    )


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPool]:
    """New interpreters that have imported what trials need; they are ended with the context."""
    spawn: Any = multiprocessing.get_context("spawn")
    pool = ProcessPool(workers, _MOST_BATCHES, prepare_process, [folder_of_own_modules()], spawn)
    with set_environment(dict.fromkeys((*THREADS, SAFE_PATH), "1")):
        try:
            _start(pool)
            yield pool
        except BrokenProcessPool as error:
            raise RuntimeError(
                "worker processes end before they have begun a trial; use fewer of them if memory is short, and in a "
                'script of your own start sweeps under `if __name__ == "__main__":`'
            ) from error
        finally:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


def run_locally(batches: Sequence[Batch], inputs: SweepInputs, workers: int, limit_s: float, emit: Emit) -> None:
    """Run all batches in processes on this machine.

    Raises:
        InputError: A worker found that the request cannot be honoured.
        RuntimeError: A trial could not be run, or processes end before they have begun one.
    """
    with process_pool(min(workers, len(batches))) as pool:
        run_in_pool(pool, batches, inputs, workers, limit_s, emit)


def run_in_pool(
    pool: ProcessPool, batches: Sequence[Batch], inputs: SweepInputs, workers: int, limit_s: float, emit: Emit
) -> None:
    """Run all batches in processes that are there already, as `run_locally` does."""
    waiting = deque(batches)
    running: dict[Future[list[Ended]], Batch] = {}
    while waiting or running:
        while waiting and len(running) < _AHEAD * workers:
            batch = waiting.popleft()
            running[pool.schedule(_run_batch, [batch, inputs], timeout=limit_s)] = batch
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            waiting.extendleft(_take(future, running.pop(future), inputs, emit))


def _take(future: Future[list[Ended]], batch: Batch, inputs: SweepInputs, emit: Emit) -> list[Batch]:
    """Emit what came of a batch, and return the batches to be run in its place."""
    try:
        for record, wall in future.result():
            emit(record, wall)
        return []
    except (ProcessExpired, TimeoutError) as error:
        if len(batch) > 1:
            return [(trial,) for trial in batch]
        (trial,) = batch
        record = record_lost_trial(trial, inputs.content[trial.scenario], _code_of(error))
        emit(record, timing(record, None, None, None, {"worker": getattr(error, "pid", None)}))
        return []


def run_request_alone(request: Request, limit_s: float) -> TrialRecord:
    """What `run_request` does, in a process of its own that may take so much wall time.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal asked for an end.
    """
    scenario, settings = checked_request(request)
    check_limit(limit_s)
    with stop_at_signals(), process_pool(1) as pool:
        try:
            record: TrialRecord = pool.schedule(run_request, [request], timeout=limit_s).result()
            return record
        except (ProcessExpired, TimeoutError) as error:
            return record_lost_request(request, settings, scenario, _code_of(error))


def prepare_process(folder: str) -> None:
    """The first that a process of a pool does: what is printed there, by whatever code, goes to standard error.

    Args:
        folder: Of modules that are named as `module:name`; empty for none.
    """
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    os.environ.pop(SAFE_PATH)
    add_own_modules(folder)


def _start(pool: ProcessPool) -> None:
    """Start the processes of a pool, deaf to Ctrl-C: it is for this process, which ends them."""
    if hasattr(signal, "pthread_sigmask"):
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        assert pool.active
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _code_of(error: Exception) -> str:
    return "time_limit" if isinstance(error, TimeoutError) else "worker_died"


def _run_batch(batch: Batch, inputs: SweepInputs) -> list[Ended]:
    """In a process of a pool: what comes of a batch."""
    if not _WORKERS:
        _WORKERS.append(Worker(inputs, {"worker": os.getpid()}))
    return list(_WORKERS[0].run(batch))
