"""P4: a thousand observations of one assembly at once, against the loop over them.

The loop has the equations of every observation built beforehand; the batch builds its own as it goes.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from apo_bench.geometry.arrays import Array
from benchmarks.corrector_bench import own
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.peers import Peer, Task, newton
from benchmarks.corrector_bench.problems import FIGURES, problem
from benchmarks.corrector_bench.rows import Row

TARGET = {"fig2": ">= 6", "fig3": ">= 4", "fig6": ">= 2"}
ROUNDS = 3


def suite(draws: int) -> list[Row]:
    """Five times as many observations as draws."""
    return [row for name in FIGURES for row in _rows(name, 5 * draws)]


def _rows(name: str, size: int) -> list[Row]:
    of = problem(name)
    given = [draw(of, "2/1", seed) for seed in range(size)]
    seen, covariance = np.array([one.seen for one in given]), np.array([one.covariance for one in given])
    tasks = [Task(of, of.system(one.seen), one.seen, one.covariance) for one in given]
    ms = []
    for _ in range(ROUNDS):
        batch, all_at_once = _timed(lambda: own.together(of, seen, covariance))
        slow, _ = _timed(lambda: _loop(newton, tasks))
        single, one_by_one = _timed(lambda: _loop(own.contact, tasks))
        ms.append((batch, slow, single))
    batch, slow, single = (float(x) for x in np.median(ms, axis=0))
    off = 1e3 * float(np.abs(all_at_once - one_by_one)[:, :, :3, 3].max())
    detail = {"observations": size, "batch_ms": batch, "newton_loop_ms": slow, "contact_loop_ms": single}
    return [
        Row("P4", name, "loop of the paper's Newton over the batch, time", slow / batch, TARGET[name], "", detail),
        Row("P4", name, "loop of contact over the batch, time", single / batch, TARGET[name], "", detail),
        Row("P4", name, "batch against loop, largest difference, mm", off, "<= 1e-6"),
    ]


def _loop(peer: Peer, tasks: list[Task]) -> Array:
    return np.array([peer(task)() for task in tasks])


def _timed(verb: Callable[[], Array]) -> tuple[float, Array]:
    """Milliseconds of the processor, and what came of it."""
    start = time.process_time()
    found = verb()
    return 1e3 * (time.process_time() - start), found
