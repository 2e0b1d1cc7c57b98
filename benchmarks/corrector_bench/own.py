"""The package's corrector behind the shapes that are measured: the one place that knows its calls.

`whole` is timed from the equations and a covariance to goals at rest and their rank, as the yardstick has it; `alone`
has the equations in compact form and the factors of the covariance beforehand, and leaves the rank to who asks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.geometry.arrays import Array
from benchmarks.corrector_bench.draws import Draw, factors
from benchmarks.corrector_bench.peers import Run, Task
from benchmarks.corrector_bench.problems import Problem


def contact(task: Task) -> Run:
    """Plain numpy, whole."""
    from apo_bench.correction.solvers.compact import compact_equations
    from apo_bench.correction.solvers.manifold import nearest_goals

    return _whole(task, compact_equations, nearest_goals)


def contact_alone(task: Task) -> Run:
    """Plain numpy, the solve alone."""
    from apo_bench.correction.solvers.manifold import nearest_goals

    return _alone(task, nearest_goals)


def compiled(task: Task) -> Run:
    """The optional compiled kernel, whole."""
    from apo_bench.correction.solvers.compiled import compact_equations_compiled, nearest_goals_compiled

    return _whole(task, compact_equations_compiled, nearest_goals_compiled)


def compiled_alone(task: Task) -> Run:
    """The optional compiled kernel, the solve alone."""
    from apo_bench.correction.solvers.compiled import nearest_goals_compiled

    return _alone(task, nearest_goals_compiled)


def _whole(task: Task, compact: Callable[..., CompactEquations], nearest: Callable[..., Any]) -> Run:
    from apo_bench.correction.posterior import jacobian_rank

    def run() -> Array:
        found = nearest(compact(task.system, len(task.seen)), task.seen, factors(task.covariance))
        jacobian_rank(found.Jt)
        return np.asarray(found.goals)

    return run


def _alone(task: Task, nearest: Callable[..., Any]) -> Run:
    from apo_bench.correction.solvers.compact import compact_equations

    system, L = compact_equations(task.system, len(task.seen)), factors(task.covariance)
    return lambda: nearest(system, task.seen, L).goals


def dense(task: Task) -> Run:
    """Plain numpy, whole, on dense matrices whatever the size."""
    from apo_bench.correction.solvers.compact import compact_equations
    from apo_bench.correction.solvers.manifold import NearestGoals, nearest_goals

    def one_of_one(system: CompactEquations, seen: Array, L: Array) -> NearestGoals:
        found = nearest_goals(system, seen[None], L[None])
        return replace(found, goals=found.goals[0], Jt=found.Jt[0])

    return _whole(task, compact_equations, one_of_one)


COMPILED = "contact compiled"
PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType(
    {
        "contact": contact,
        "contact alone": contact_alone,
        COMPILED: compiled,
        f"{COMPILED} alone": compiled_alone,
        "contact dense": dense,
    }
)


def observation(of: Problem, given: Draw, assembly: Assembly | None = None) -> Observation:
    """What a corrector is handed, of another assembly if one is given."""
    seen = np.ones(of.n, dtype=np.bool_)
    return Observation(of.assembly if assembly is None else assembly, of.start, given.seen, given.covariance, seen)


def corrected(seen: Observation, name: str = "contact") -> Correction:
    """By the corrector itself, with its test and its posterior."""
    from apo_bench.correction.correctors import correct

    return correct(seen, name)


def together(of: Problem, seen: Array, covariance: Array) -> Array:
    """Goals of many observations, (b, n, 4, 4), covariance (b, n, 6, 6), plain numpy, in chunks as the package does."""
    from apo_bench.correction.many import BATCH, compact_many
    from apo_bench.correction.solvers.manifold import nearest_goals

    pattern, L = of.system(seen[0]), factors(covariance)
    found = []
    for i in range(0, len(seen), BATCH):
        some = seen[i : i + BATCH]
        found.append(nearest_goals(compact_many(of.assembly, pattern, some), some, L[i : i + BATCH]).goals)
    return np.concatenate(found)
