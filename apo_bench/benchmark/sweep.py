"""Many trials: spread over processes, each row written as its trial ends, resumed where it was left."""

from __future__ import annotations

import multiprocessing
import os
import platform
import queue
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, final

from apo_bench.benchmark.fingerprint import content_hash, noise_content
from apo_bench.benchmark.grid import KEY, SweepSpec, Unit, described, load_all, trial_key, units
from apo_bench.benchmark.journal import Journal, run_record
from apo_bench.benchmark.recognised import KINDS as RECOGNISED
from apo_bench.benchmark.spec import TrialSpec
from apo_bench.benchmark.stages import Shown, show
from apo_bench.benchmark.trial import Row, run_trial
from apo_bench.correction.correct import CORRECTORS
from apo_bench.errors import InputError
from apo_bench.names import resolve
from apo_bench.observation.noise import Level, make_noise
from apo_bench.observation.relations import make_relations
from apo_bench.scenario_file import load_scenario
from apo_bench.simulation.arm import find_arm
from apo_bench.simulation.scene import Scene, build_scene

LARGEST_WORKERS = 256
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Emit = Callable[[Row, dict[str, Any]], None]


def sweep(spec: SweepSpec, out: str | Path, *, workers: int = 1, command: str = "") -> list[Row]:
    """Run every trial of a sweep that has no row yet.

    The rows depend on neither the number of workers nor the order in which trials end. With more than one worker
    the processes are spawned, so a script that calls this needs the usual `if __name__ == "__main__":`.

    Args:
        out: The folder of the rows; made if it is not there, continued if it holds rows of the same sweep.
        command: What to note in `run.json` as the command line.

    Returns:
        All rows of the folder.

    Raises:
        InputError: A setting that is not allowed, or a folder with trials of another sweep.
        RuntimeError: A worker died.
        KeyboardInterrupt: Passed on after the rows of the trials that had ended were written.
    """
    if not 1 <= workers <= LARGEST_WORKERS:
        raise InputError(f"{workers} workers were given; a whole number from 1 to {LARGEST_WORKERS} is allowed.")
    loaded = load_all(spec)
    for noise in spec.noises:
        make_noise(noise, Level(max(spec.levels), max(spec.levels)))
    for relations in spec.relations:
        if relations not in RECOGNISED:
            make_relations(relations)
    arm = find_arm(spec.arm)
    for method in spec.methods:
        if method not in ("oracle", "none"):
            resolve(method, CORRECTORS, "corrector")
    content = {given: content_hash(scenario, given, arm.mjcf) for given, scenario in loaded.items()}
    by_name = {loaded[given].name: hashed for given, hashed in content.items()} | noise_content(*spec.noises)
    with Journal(Path(out), run_record(described(spec, loaded), by_name, command)) as journal:
        finished = journal.finished
        work = [
            Unit(tuple(t for t in unit.trials if trial_key(t, loaded[t.scenario].name) not in finished))
            for unit in units(spec, loaded)
        ]
        work = [unit for unit in work if unit.trials]
        with _progress(sum(len(unit.trials) for unit in work)) as tick:

            def emit(row: Row, timing: dict[str, Any]) -> None:
                journal.append(row, timing)
                tick()

            if workers == 1:
                worker = Worker(0)
                for unit in work:
                    worker.run(unit, emit)
            else:
                _spread(work, min(workers, max(1, len(work))), emit)
        return journal.rows


@final
class Worker:
    """Runs units of work; compiles each scene once."""

    def __init__(self, number: int) -> None:
        self.number = number
        self._scenes: dict[tuple[str, float, str], tuple[Scene, str]] = {}

    def run(self, unit: Unit, emit: Emit, stopped: Callable[[], bool] = lambda: False) -> None:
        """Run the trials of a unit, demonstrations shared, and emit each row with its timing."""
        demonstrations: dict[tuple[float, str], Shown] = {}
        for spec in unit.trials:
            if stopped():
                return
            began = time.perf_counter()
            scene, content = self._scene(spec)
            ready = time.perf_counter()
            key = (spec.careless, spec.eye)
            if key not in demonstrations:
                demonstrations[key] = show(scene, spec.careless, spec.seed, spec.eye)
            shown = time.perf_counter()
            row = run_trial(spec, scene, shown=demonstrations[key], content=content)
            emit(row, self._timing(row, began, ready, shown, time.perf_counter()))

    def _scene(self, spec: TrialSpec) -> tuple[Scene, str]:
        key = (spec.scenario, spec.clearance_mm, spec.grasp)
        if key not in self._scenes:
            scene = build_scene(
                load_scenario(spec.scenario),
                clearance_mm=spec.clearance_mm,
                grasp=spec.grasp,
                arm=spec.arm,
                timestep_s=spec.timestep_s,
            )
            self._scenes[key] = (scene, content_hash(scene.scenario, spec.scenario, scene.arm.mjcf))
        return self._scenes[key]

    def _timing(self, row: Row, began: float, ready: float, shown: float, ended: float) -> dict[str, Any]:
        """Wall times of a trial; compiling and demonstrating are paid by the first trial that needs them."""
        return {
            **{key: row[key] for key in KEY},
            "compile_s": ready - began,
            "demonstrate_s": shown - ready,
            "trial_s": ended - shown,
            "host": platform.node(),
            "worker": self.number,
        }


def _spread(work: list[Unit], workers: int, emit: Emit) -> None:
    context = multiprocessing.get_context("spawn")
    tasks: Any = context.Queue()
    said: Any = context.Queue()
    stop = context.Event()
    for unit in [*work, *[None] * workers]:
        tasks.put(unit)
    crew = [context.Process(target=_work, args=(i, tasks, said, stop), daemon=True) for i in range(workers)]
    with _one_thread_each():
        for process in crew:
            process.start()
    try:
        _listen(crew, said, emit)
    except BaseException:
        stop.set()
        _write_what_ended(crew, said, emit)
        raise
    finally:
        tasks.cancel_join_thread()
        for process in crew:
            process.join(timeout=5.0)
            if process.is_alive():
                process.terminate()


def _listen(crew: list[Any], said: Any, emit: Emit) -> None:
    """Take rows until every worker has said that it is done."""
    working = len(crew)
    while working:
        try:
            kind, *news = said.get(timeout=1.0)
        except queue.Empty:
            for process in crew:
                if process.exitcode not in (None, 0):
                    raise RuntimeError(
                        f"a worker ended with exit code {process.exitcode}; "
                        "the same command continues, with fewer workers if memory was short"
                    ) from None
            continue
        if kind == "row":
            emit(*news)
        elif kind == "done":
            working -= 1
        elif kind == "refused":
            raise InputError(news[0])
        else:
            raise RuntimeError(f"a trial could not be run:\n{news[0]}")


def _write_what_ended(crew: list[Any], said: Any, emit: Emit) -> None:
    """After a stop: wait for the trials under way, and write their rows."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            kind, *news = said.get(timeout=0.2)
        except queue.Empty:
            if not any(process.is_alive() for process in crew):
                return
            continue
        if kind == "row":
            emit(*news)


def _work(number: int, tasks: Any, said: Any, stop: Any) -> None:
    """The life of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    worker = Worker(number)
    parent = multiprocessing.parent_process()

    def stopped() -> bool:
        """Asked to stop, or alone: rows of a process whose parent was killed would be written by nobody."""
        return stop.is_set() or (parent is not None and not parent.is_alive())

    try:
        while not stopped() and (unit := tasks.get()) is not None:
            worker.run(unit, lambda row, timing: said.put(("row", row, timing)), stopped)
        said.put(("done",))
    except InputError as error:
        said.put(("refused", str(error)))
    except Exception:
        said.put(("failed", traceback.format_exc()))


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Children inherit one thread per linear algebra library: the processes already fill the cores."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _progress(total: int) -> Iterator[Callable[[], Any]]:
    """A bar with an estimate on a terminal's stderr; silent anywhere else."""
    from tqdm import tqdm

    with tqdm(total=total, unit="trial", file=sys.stderr, disable=not sys.stderr.isatty(), smoothing=0.05) as bar:
        yield bar.update
