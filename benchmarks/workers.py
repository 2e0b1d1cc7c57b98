"""How much faster two workers are than one: `python benchmarks/workers.py [--trials 12] [--rounds 3]`.

The same trials, with one worker and with two, in turns. Counted is the time from the last row of the first seed to the
last row of all: processes have started and compiled their scenes by then, which a sweep does once; the end, at which
one of two waits for the other, counts. Writes benchmarks/results/workers.json; run it on a machine that does nothing
else.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

from apo_bench.records.row import Row
from apo_bench.simulation.scene.arm import find_arm
from apo_bench.sweeps.environment_lock import environment_lock, names_of
from apo_bench.sweeps.grid import SweepSettings, load_all, units
from apo_bench.sweeps.local.pool import spread
from apo_bench.sweeps.worker import Timing

SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
RESULT = Path(__file__).parent / "results" / "workers.json"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--trials", type=int, default=12, help="seeds per cell")
    asked.add_argument("--rounds", type=int, default=3, help="how often both are timed")
    given = asked.parse_args()
    rounds = []
    for _ in range(given.rounds):
        one, two = (rows_per_second(workers, given.trials) for workers in (1, 2))
        rounds.append({"one": round(one, 3), "two": round(two, 3), "ratio": round(two / one, 3)})
        print(f"one worker {one:.2f} rows/s, two {two:.2f}: {two / one:.2f} times", flush=True)
    ratio = statistics.median(r["ratio"] for r in rounds)
    print(f"median {ratio:.2f}")
    command = f"python benchmarks/workers.py --trials {given.trials} --rounds {given.rounds}"
    found = {"command": command, "rows_per_second": rounds, "median_ratio": ratio}
    RESULT.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


def rows_per_second(workers: int, trials: int) -> float:
    """Of trials at fidelity contact, from the second seed on."""
    grid = SweepSettings(SCENARIOS, (1.0,), (0.0, 1.0), ("none", "paper", "contact"), trials=trials, fidelity="contact")
    loaded, arm = load_all([grid]), find_arm(grid.arm).mjcf
    lock = environment_lock(names_of([grid]), loaded, arm)
    ended: list[tuple[float, int]] = []

    def emit(row: Row, timing: Timing) -> None:
        ended.append((time.perf_counter(), row["seed"]))

    spread(tuple(units([grid], loaded)), lock, workers=workers, limit_s=600.0, emit=emit)
    warm = max(at for at, seed in ended if seed == grid.seed)
    later = [at for at, _ in ended if at > warm]
    return len(later) / (later[-1] - warm)


if __name__ == "__main__":
    main()
