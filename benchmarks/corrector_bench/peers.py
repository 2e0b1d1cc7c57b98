"""Every solver behind one shape: `prepare(task)` may build what it likes; what it returns is timed.

The equations of a draw are one `Equations` object that all share, built before the clock runs. `newton` is the frozen
yardstick: the paper's Newton with the package's own settings, all goals free.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from apo_bench.assembly import Equations
from apo_bench.geometry import Array
from benchmarks.corrector_bench.problems import Problem


class Task(NamedTuple):
    """One observation to be corrected."""

    of: Problem
    system: Equations
    seen: Array
    """(n, 4, 4)."""
    covariance: Array
    """(n, 6, 6)."""


Run = Callable[[], Array]
"""Solves the task; corrected goals (n, 4, 4)."""
Peer = Callable[[Task], Run]


def peers() -> dict[str, Peer]:
    """Name -> how to prepare it."""
    from benchmarks.corrector_bench import own

    return {"newton": newton, **own.PEERS}


def newton(task: Task) -> Run:
    """Section 3.3's Newton with minimum-norm steps, as `paper` uses it."""
    from apo_bench.correction.solvers.newton import solve_newton

    free = range(len(task.seen))
    return lambda: solve_newton(task.system, task.seen, free).goals
