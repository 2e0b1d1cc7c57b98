"""`manifold.nearest_goals` for one observation of many operations, on sparse matrices."""

from __future__ import annotations

import numpy as np

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.manifold import (
    MOST_TURNS,
    SMALLEST,
    NearestGoals,
    SolverTurn,
    damping,
    settles,
    shortened_step,
)
from apo_bench.correction.solvers.sparse import incidence, sparse_solver
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import exp_and_jacobian

_SURE, _NEXT = 1e-5, 1e-7
"""As `SURE` and `NEXT`: rounding of thousands of operations is larger."""


def nearest_goals_sparse(
    system: CompactEquations, observed: Array, L: Array, soft_m: Array | None = None, begin: Array | None = None
) -> NearestGoals:
    """Sparse `manifold.nearest_goals` of one set of goals (n, 4, 4); the Jacobian of the result is sparse, too."""
    n, m = system.n, 3 * len(system)
    where = incidence(system)
    solve = sparse_solver(where)
    z, T, B = np.zeros(6 * n), observed, L
    if begin is not None:
        D, Jr = exp_and_jacobian((L @ begin.reshape(n, 6, 1))[..., 0])
        z, T, B = begin, observed @ D, Jr @ L
    before, trace, rest, finite = np.inf, list[SolverTurn](), False, True
    blocks = np.zeros((len(where.contact), 6, 3))
    for turn in range(MOST_TURNS):
        e, every = system.blocks(T, B)
        blocks = every[where.contact, where.letter]
        size = float((blocks * blocks).sum()) / max(m, 1)
        finite = bool(np.isfinite(size + e.sum()))
        if not finite:
            break
        demanded = e if soft_m is None else e * (soft_m == 0.0)
        mu = damping(np.array(float(demanded @ demanded) / max(m * size, SMALLEST)), turn) * size
        added = np.full(m, max(float(mu), SMALLEST)) + (0.0 if soft_m is None else soft_m * soft_m)
        step = solve(added, blocks, where.times(blocks, z) - e) - z
        length = float(np.abs(step).max(initial=0.0))
        trace.append(SolverTurn(float(np.abs(e).max(initial=0.0)), length))
        rest = bool(settles(np.array(length), np.array(before), _SURE, _NEXT))
        z = z + (step if rest else shortened_step(step[None], L[None])[0])
        D, Jr = exp_and_jacobian((L @ z.reshape(n, 6, 1))[..., 0])
        T, B, before = observed @ D, Jr @ L, length
        if rest:
            break
    if not finite:
        z, T = np.zeros(6 * n), observed
    Jt = where.matrix(blocks).T
    return NearestGoals(T, z, system.residual(T), Jt, B, np.array(rest and finite), np.array(finite), tuple(trace))
