"""One peer on one problem, in a process of its own: `python -m benchmarks.corrector_bench.worker`, as the runner says.

Arguments: peer, problem, level, per_part (0 or 1), seeds (first:last), the file to write (.npz), what else is timed in
turn (comma-separated). Every draw is solved by each in turn, so that a machine whose speed drifts treats all alike.
Times are of the processor: on a machine with other work a clock on the wall measures that too, and favours whoever is
done within a slice. Those of the clock are written as well.
"""

from __future__ import annotations

import os
import sys
import time
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.peers import Peer, Task, peers
from benchmarks.corrector_bench.problems import problem

FAILED = -1.0


class Spent(NamedTuple):
    """Milliseconds of one solve."""

    ms: float
    """Of the processor, all threads."""
    wall_ms: float


def main(peer: str, name: str, noise_level: str, per_part: str, seeds: str, out: str, beside: str = "") -> None:
    """Writes goals (k, n, 4, 4) of the peer and milliseconds (k, 1 + beside) of all."""
    known = peers()
    of = problem(name)
    turn = [peer, *[other for other in beside.split(",") if other]]
    first, last = map(int, seeds.split(":"))
    goals = []
    times = []
    wall = []
    for seed in range(first, last):
        given = draw(of, noise_level, seed, per_part == "1")
        task = Task(of, of.system(given.seen), given.seen, given.covariance)
        ended = [_timed(known[each], task, again=seed == first) for each in turn]
        goals.append(ended[0][0])
        times.append([spent.ms for _, spent in ended])
        wall.append([spent.wall_ms for _, spent in ended])
        np.savez(out + ".part.npz", goals=np.array(goals), ms=np.array(times), wall_ms=np.array(wall))
        os.replace(out + ".part.npz", out)


def _timed(peer: Peer, task: Task, again: bool) -> tuple[Array, Spent]:
    """Goals and times; goals of NaN and `FAILED` if it raised. The first call of a process warms up."""
    try:
        for _ in range(1 + again):
            run = peer(task)
            clock = time.perf_counter()
            start = time.process_time()
            goals = run()
            spent = Spent(1e3 * (time.process_time() - start), 1e3 * (time.perf_counter() - clock))
        return np.asarray(goals, dtype=np.float64), spent
    except Exception as error:  # a peer may fail in any way; that is a result
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return np.full(task.seen.shape, np.nan), Spent(FAILED, FAILED)


if __name__ == "__main__":
    main(*sys.argv[1:])
