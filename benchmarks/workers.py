"""Workers: how fast they start, and how much faster two are than one, as processes and as threads.

`python benchmarks/workers.py [--trials 12] [--rounds 3]`

The same trials, with one worker, with two processes and with two threads of one process, in turns. Counted is the time
from the last row of the first seed to the last row of all: processes have started and compiled their scenes by then,
which a sweep does once; the end, at which one of two waits for the other, counts. A cold start is that of a new
interpreter: until a worker begins its first trial, and one whole `apo-bench replay stick_in_tower`; the least of all
rounds, wall time and the processor's. Writes benchmarks/results/workers.json; run it on a machine that does nothing
else.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections import deque
from pathlib import Path
from threading import Thread

from apo_bench.records import Row
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.grid import SweepSettings, load_all, units
from apo_bench.sweeps.local.pool import run_locally
from apo_bench.sweeps.sweep import names_of
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Unit, environment_lock
from apo_bench.sweeps.work.worker import Emit, Timing, Worker

SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
WAYS = ("one", "two", "threads")
RESULT = Path(__file__).parent / "results" / "workers.json"
_REPLAY = ("-m", "apo_bench.cli.app", "replay", "stick_in_tower", "--json")
_WORKER = """
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.sweep import names_of
from apo_bench.sweeps.work.environment_lock import environment_lock
from apo_bench.sweeps.grid import SweepSettings, load_all, units
from apo_bench.sweeps.local import pool
grid = SweepSettings(("stick_in_tower",), (1.0,), (1.0,), ("contact",), trials=1)
loaded = load_all([grid])
lock = environment_lock(names_of([grid]), loaded, find_arm(grid.arm).files)
assert next(pool.Worker(0, lock).run(next(iter(units([grid], loaded))))) == ("began",)
"""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--trials", type=int, default=12, help="seeds per cell")
    asked.add_argument("--rounds", type=int, default=3, help="how often all are timed")
    given = asked.parse_args()
    rounds = []
    for _ in range(given.rounds):
        found = {way: round(rows_per_second(way, given.trials), 3) for way in WAYS}
        rounds.append(found | {"ratio": found["two"] / found["one"], "threads_ratio": found["threads"] / found["one"]})
        print(", ".join(f"{way} {speed:.2f} rows/s" for way, speed in found.items()), flush=True)
    cold = {"worker": cold_start(("-c", _WORKER), given.rounds), "replay": cold_start(_REPLAY, given.rounds)}
    print(cold)
    command = f"python benchmarks/workers.py --trials {given.trials} --rounds {given.rounds}"
    medians = {f"median_{name}": statistics.median(r[name] for r in rounds) for name in ("ratio", "threads_ratio")}
    found = {"command": command, "rows_per_second": rounds, **medians, "cold_start_s": cold}
    RESULT.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def rows_per_second(way: str, trials: int) -> float:
    """Of trials at fidelity contact, from the second seed on."""
    grid = SweepSettings(SCENARIOS, (1.0,), (0.0, 1.0), ("none", "paper", "contact"), trials=trials, fidelity="contact")
    loaded = load_all([grid])
    arm = find_arm(grid.arm).files
    lock = environment_lock(names_of([grid]), loaded, arm)
    ended: list[tuple[float, int]] = []

    def emit(row: Row, timing: Timing) -> None:
        ended.append((time.perf_counter(), row["seed"]))

    work = tuple(units([grid], loaded))
    if way == "threads":
        _by_threads(work, lock, emit, 2)
    else:
        run_locally(work, lock, workers=1 + WAYS.index(way), limit_s=600.0, emit=emit)
    warm = max(at for at, seed in ended if seed == grid.seed)
    later = [at for at, _ in ended if at > warm]
    return len(later) / (later[-1] - warm)


def _by_threads(work: tuple[Unit, ...], lock: EnvironmentLock, emit: Emit, count: int) -> None:
    """Threads of this process that share the work; each has scenes of its own."""
    left = deque(work)

    def live(number: int) -> None:
        worker = Worker(number, lock)
        while left:
            for kind, *said in worker.run(left.popleft()):
                if kind == "row":
                    emit(*said)

    threads = [Thread(target=live, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def cold_start(arguments: tuple[str, ...], rounds: int) -> dict[str, float]:
    """The least wall time of a new interpreter, and the least time of the processor, [s]."""
    walls = []
    used = []
    for _ in range(rounds):
        began = time.perf_counter()
        before = _used()
        subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
        walls.append(time.perf_counter() - began)
        used.append(_used() - before)
    return {"wall": round(min(walls), 2), "processor": round(min(used), 2)}


def _used() -> float:
    """What children that have ended took of the processor, [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


if __name__ == "__main__":
    main()
