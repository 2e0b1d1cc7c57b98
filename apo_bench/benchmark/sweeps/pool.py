"""Run the batches of a sweep in processes on this machine.

If a process dies or exceeds its time limit, its batch runs again trial by trial. So only the trial that caused it gets
a failed record.
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
from apo_bench.benchmark.sweeps.stop_signals import stop_at_signals
from apo_bench.benchmark.sweeps.worker import Ended, SweepInputs, Timing, Worker, make_timing
from apo_bench.errors import require
from apo_bench.io import SAFE_PATH, set_environment
from apo_bench.names import add_own_modules, folder_of_own_modules
from apo_bench.records import TrialRecord
from apo_bench.trial.record_start_and_end import record_lost_trial
from apo_bench.trial.request import Request, checked_request, record_lost_request, run_request

Emit = Callable[[TrialRecord, Timing], None]
"""Takes the record and timing of a finished trial; called exactly once for each trial of a sweep."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that limit the threads of linear algebra libraries to one, since the processes already use all cores."""
_MOST_BATCHES = 200
"""Number of batches after which a process is replaced, to release its memory."""
_AHEAD = 2
"""Number of batches per process that are submitted: one runs, the others wait."""
_LONGEST_TRIAL_S = 1e6
_WORKERS: list[Worker] = []
"""In a process of a pool: a list with its worker, empty before its first batch."""


def check_limit(limit_s: float) -> None:
    """Raise an `InputError` unless this is a valid time limit of a trial."""
    require(
        math.isfinite(limit_s) and 0.0 < limit_s <= _LONGEST_TRIAL_S,
        f"a limit of {limit_s:g} s per trial was given; a number above 0 and up to {_LONGEST_TRIAL_S:g} is allowed.",
    )


@contextmanager
def make_process_pool(workers: int) -> Iterator[ProcessPool]:
    """Start processes that have imported what trials need; they are stopped at the end of the context."""
    spawn: Any = multiprocessing.get_context("spawn")  # forked processes would share state
    pool = ProcessPool(workers, _MOST_BATCHES, prepare_process, [folder_of_own_modules()], spawn)
    with set_environment(dict.fromkeys((*THREADS, SAFE_PATH), "1")):
        try:
            _start_pool(pool)
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
        InputError: A worker found that the settings or files do not allow a trial.
        RuntimeError: A trial could not be run, or processes end before they have begun one.
    """
    with make_process_pool(min(workers, len(batches))) as pool:
        run_in_pool(pool, batches, inputs, workers, limit_s, emit)


def run_in_pool(
    pool: ProcessPool, batches: Sequence[Batch], inputs: SweepInputs, workers: int, limit_s: float, emit: Emit
) -> None:
    """Run all batches in an existing pool, as `run_locally` does."""
    waiting = deque(batches)
    running: dict[Future[list[Ended]], Batch] = {}
    while waiting or running:
        while waiting and len(running) < _AHEAD * workers:
            batch = waiting.popleft()
            running[pool.schedule(_run_batch, [batch, inputs], timeout=limit_s)] = batch
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            waiting.extendleft(
                _take_results(future, running.pop(future), inputs, emit)
            )  # trials of a failed batch come first


def _take_results(future: Future[list[Ended]], batch: Batch, inputs: SweepInputs, emit: Emit) -> list[Batch]:
    """Emit the results of a batch, and return the batches that replace it if its process died or was too slow."""
    try:
        for record, wall in future.result():
            emit(record, wall)
        return []
    except (ProcessExpired, TimeoutError) as error:
        if len(batch) > 1:
            return [(trial,) for trial in batch]
        (trial,) = batch
        record = record_lost_trial(trial, inputs.content[trial.scenario], _get_failure_code(error))
        emit(record, make_timing(record, None, None, None, {"worker": getattr(error, "pid", None)}))
        return []


def run_request_alone(request: Request, limit_s: float) -> TrialRecord:
    """Run a request as `run_request` does, but in a process of its own with a wall time limit.

    Raises:
        InputError: A setting is not allowed, or two settings contradict each other.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal ended the program.
    """
    scenario, settings = checked_request(request)
    check_limit(limit_s)
    with stop_at_signals(), make_process_pool(1) as pool:
        try:
            record: TrialRecord = pool.schedule(run_request, [request], timeout=limit_s).result()
            return record
        except (ProcessExpired, TimeoutError) as error:
            return record_lost_request(request, settings, scenario, _get_failure_code(error))


def prepare_process(folder: str) -> None:
    """Prepare a process of a pool: redirect everything that is printed to standard error, and find user modules.

    Args:
        folder: Folder of modules that are named as `module:name`; empty for none.
    """
    os.dup2(2, 1)  # also what libraries print below Python
    sys.stdout = sys.stderr
    os.environ.pop(SAFE_PATH)  # needed only while the process starts
    add_own_modules(folder)


def _start_pool(pool: ProcessPool) -> None:
    """Start the processes of a pool with SIGINT blocked, since the parent process handles Ctrl-C and ends them."""
    if hasattr(signal, "pthread_sigmask"):
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        assert pool.active  # starts the processes, which inherit the blocked signal
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _get_failure_code(error: Exception) -> str:
    return "time_limit" if isinstance(error, TimeoutError) else "worker_died"


def _run_batch(batch: Batch, inputs: SweepInputs) -> list[Ended]:
    """Run a batch; called in a process of a pool, which keeps its worker for later batches."""
    if not _WORKERS:
        _WORKERS.append(Worker(inputs, {"worker": os.getpid()}))
    return list(_WORKERS[0].run(batch))
