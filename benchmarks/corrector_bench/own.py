"""The package's corrector behind the shapes that are measured: the one place that knows its calls.

A solve is timed whole: from the equations and a covariance to goals at rest and their rank, as the yardstick has it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry.arrays import Array
from apo_bench.program import Correction, Observation
from benchmarks.corrector_bench.draws import Draw
from benchmarks.corrector_bench.peers import Run, Task
from benchmarks.corrector_bench.problems import Problem


def contact(task: Task) -> Run:
    """Plain numpy."""
    from apo_bench.correction.compact import compact
    from apo_bench.correction.manifold import nearest
    from apo_bench.correction.posterior import rank

    def run() -> Array:
        found = nearest(compact(task.system, len(task.seen)), task.seen, np.linalg.cholesky(task.covariance))
        rank(found.Jt)
        return found.goals

    return run


def compiled(task: Task) -> Run:
    """The same by the optional compiled kernel."""
    from apo_bench.correction.compact import compact
    from apo_bench.correction.compiled import nearest
    from apo_bench.correction.posterior import rank

    def run() -> Array:
        found = nearest(compact(task.system, len(task.seen)), task.seen, np.linalg.cholesky(task.covariance))
        rank(found.Jt)
        return found.goals

    return run


def dense(task: Task) -> Run:
    """Plain numpy on dense matrices, whatever the size."""
    from apo_bench.correction.compact import compact
    from apo_bench.correction.manifold import nearest

    L = np.linalg.cholesky(task.covariance)
    return lambda: nearest(compact(task.system, len(task.seen)), task.seen[None], L[None]).goals[0]


COMPILED = "contact compiled"
PEERS: Mapping[str, Callable[[Task], Run]] = MappingProxyType(
    {"contact": contact, COMPILED: compiled, "contact dense": dense}
)


def observation(of: Problem, given: Draw, assembly: Assembly | None = None) -> Observation:
    """What a corrector is handed, of another assembly if one is given."""
    seen = np.ones(of.n, dtype=np.bool_)
    return Observation(of.assembly if assembly is None else assembly, of.start, given.seen, given.covariance, seen)


def corrected(seen: Observation, name: str = "contact") -> Correction:
    """By the corrector itself, with its test and its posterior."""
    from apo_bench.correction.correct import correct

    return correct(seen, name)
