"""The optimum by another way: a Gauss-Newton projection with the known rank, from two starts, checked by its own law.

At each turn z moves to the shortest vector of the linearised contacts, z <- J^+ (J z - e), J^+ cut at the rank that
the geometry states (Eq. 15 to 23 know no better; here it is given). What it ends on is accepted as an optimum if the
contacts hold and z lies in the row space of J, the conditions of Karush, Kuhn and Tucker; of the two starts, what was
seen and the truth, the shorter correction counts. Nothing of the package's corrector is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Equations
from apo_bench.geometry import Array, pose, right_jacobian
from benchmarks.corrector_bench.draws import Draw, factors
from benchmarks.corrector_bench.measures import lengths
from benchmarks.corrector_bench.problems import Problem

TURNS = 100
GAP_M = 1e-12
DRIFT = 1e-9
"""When the conditions count as met: largest |e| [m], and norm of what is not in the row space [sigma]."""


class Optimum(NamedTuple):
    """The nearest consistent goals."""

    goals: Array
    length: float
    """|z|; NaN if neither start ended on a point that meets the conditions."""


def optimum(of: Problem, given: Draw, system: Equations | None = None) -> Optimum:
    """The shorter of the corrections that two starts lead to."""
    equations = of.system(given.seen) if system is None else system
    ends = [_descended(of, given, equations, z) for z in (np.zeros(6 * of.n), lengths(given, given.truth))]
    met = [end for end in ends if np.isfinite(end.length)]
    return min(met, key=lambda end: end.length) if met else Optimum(given.seen, float("nan"))


def _descended(of: Problem, given: Draw, system: Equations, z: Array) -> Optimum:
    L = factors(given.covariance)
    n = of.n
    cap = np.sqrt(6 * of.n)
    for _ in range(TURNS):
        xi = (L @ z.reshape(n, 6, 1))[..., 0]
        goals = given.seen @ pose.exp(xi)
        e, J = system.linearised(goals)
        J = np.einsum("mki,kij->mkj", J.reshape(-1, n, 6), right_jacobian(xi) @ L).reshape(-1, 6 * n)
        U, w, Vt = np.linalg.svd(J, full_matrices=False)
        U = U[:, : of.rank]
        w = w[: of.rank]
        Vt = Vt[: of.rank]
        drift = np.linalg.norm(z - Vt.T @ (Vt @ z))
        if np.abs(e).max() < GAP_M and drift < DRIFT:
            return Optimum(goals, float(np.linalg.norm(z)))
        step = Vt.T @ ((U.T @ (J @ z - e)) / w) - z
        size = np.linalg.norm(step)
        z = z + step * min(1.0, cap / size) if size > 0 else z
    return Optimum(given.seen, float("nan"))
