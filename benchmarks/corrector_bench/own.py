"""The package's corrector behind the shapes that are measured: the one place that knows its calls.

It is timed from the equations and a covariance to goals at rest and their rank, as the yardstick has it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.assembly import Assembly, Correction, Observation
from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.geometry import Array
from benchmarks.corrector_bench.draws import Draw, factors
from benchmarks.corrector_bench.peers import Run, Task
from benchmarks.corrector_bench.problems import Problem


def contact(task: Task) -> Run:
    """Plain numpy, whole."""
    from apo_bench.correction.solvers.gauss_newton import nearest_goals

    return _whole(task, nearest_goals)


def _whole(task: Task, nearest: Callable[..., Any]) -> Run:
    from apo_bench.correction.solvers.compact import compact_equations
    from apo_bench.correction.solvers.posterior import jacobian_rank

    def run() -> Array:
        found = nearest(compact_equations(task.system, len(task.seen)), task.seen, factors(task.covariance))
        jacobian_rank(found.Jt)
        return np.asarray(found.goals)

    return run


def dense(task: Task) -> Run:
    """Plain numpy, whole, on dense matrices whatever the size."""
    from apo_bench.correction.solvers.gauss_newton import NearestGoals, nearest_goals

    def one_of_one(system: CompactEquations, seen: Array, L: Array) -> NearestGoals:
        found = nearest_goals(system, seen[None], L[None])
        return found.at(0)

    return _whole(task, one_of_one)


PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType({"contact": contact, "contact dense": dense})


def observation(of: Problem, given: Draw, assembly: Assembly | None = None) -> Observation:
    """What a corrector is handed, of another assembly if one is given."""
    seen = np.ones(of.n, dtype=np.bool_)
    return Observation(of.assembly if assembly is None else assembly, of.start, given.seen, given.covariance, seen)


def corrected(seen: Observation, name: str = "contact") -> Correction:
    """By the corrector itself, with its test and its posterior."""
    from apo_bench.correction.correctors import correct

    return correct(seen, name)
