"""P5: how time grows with the graph, and what the sparse way gains; every size in turn, round after round."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from apo_bench.geometry import Array
from benchmarks.corrector_bench import own
from benchmarks.corrector_bench.draws import Draw, draw
from benchmarks.corrector_bench.measures import quality
from benchmarks.corrector_bench.peers import Run, Task
from benchmarks.corrector_bench.problems import Problem, problem
from benchmarks.corrector_bench.rows import TrialRecord

CHAINS = (20, 40, 80, 200)
GRIDS = (5, 10)
DENSE = (20, 40)
FASTER = {20: ">= 4", 40: ">= 15"}
NAMES = (*(f"chain{k}" for k in CHAINS), *(f"grid{g}" for g in GRIDS))


def suite(draws: int) -> list[TrialRecord]:
    """As many rounds as a fortieth of the draws."""
    rounds = max(2, draws // 40)
    of = {name: problem(name) for name in NAMES}
    ms: dict[str, list[float]] = {name: [] for name in (*NAMES, *(f"dense chain{k}" for k in DENSE))}
    last: dict[str, tuple[Draw, Array]] = {}
    for seed in range(rounds):
        for name in NAMES:
            given, task = _task(of[name], seed)
            spent, goals = _timed(own.contact, task, warm=seed == 0)
            ms[name].append(spent)
            last[name] = given, goals
            if f"dense {name}" in ms:
                ms[f"dense {name}"].append(_timed(own.dense, task, warm=False)[0])
    median = {name: float(np.median(each)) for name, each in ms.items()}
    rows = [TrialRecord("P5", name, "contact, ms", value, "", "", {"rounds": rounds}) for name, value in median.items()]
    ratio = float(np.median(np.divide(ms["chain200"], ms["chain20"])))
    rows.append(TrialRecord("P5", "chain200", "time over that of chain20", ratio, "<= 12"))
    slope = np.polyfit(np.log(CHAINS), np.log([median[f"chain{k}"] for k in CHAINS]), 1)[0]
    rows.append(TrialRecord("P5", "chains", "growth exponent, K = 20 to 200", float(slope)))
    for k in DENSE:
        gain = float(np.median(np.divide(ms[f"dense chain{k}"], ms[f"chain{k}"])))
        rows.append(TrialRecord("P5", f"chain{k}", "dense over sparse, time", gain, FASTER[k]))
    for name in ("chain200", "grid10"):
        found = quality(of[name], *last[name])
        rows.append(TrialRecord("Q1", name, "largest residual, mm", found.residual_mm, "<= 1e-6"))
        rows.append(TrialRecord("Q2", name, "largest drift, sigma", found.drift, "<= 1e-6"))
        rows.append(TrialRecord("Q3", name, "|z| over that of the truth", found.length / found.true_length, "<= 1"))
    return rows


def _task(of: Problem, seed: int) -> tuple[Draw, Task]:
    given = draw(of, "2/1", seed)
    return given, Task(of, of.system(given.seen), given.seen, given.covariance)


def _timed(solver: Callable[[Task], Run], task: Task, warm: bool) -> tuple[float, Array]:
    for _ in range(1 + warm):
        run = solver(task)
        start = time.process_time()
        goals = run()
        ms = 1e3 * (time.process_time() - start)
    return ms, goals
