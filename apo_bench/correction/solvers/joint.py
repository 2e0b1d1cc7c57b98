"""The solver of `manifold` where operations share errors: every goal depends on every number of z."""

from __future__ import annotations

import numpy as np

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.manifold import MOST_TURNS, NearestGoals, SolverTurn, project, settles, shortened_step
from apo_bench.correction.solvers.whitened import spread
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import exp_and_jacobian


def nearest_goals_joint(
    system: CompactEquations, goals: Array, L: Array, soft_m: Array | None = None, begin: Array | None = None
) -> NearestGoals:
    """`manifold.nearest_goals` of one observation, with the factor of a joint covariance, (n, 6, 6 n)."""
    n, trace, size = len(goals), list[SolverTurn](), np.inf
    z, T, B, Jt = np.zeros(6 * n), goals, L, np.zeros((6 * n, 3 * len(system)))
    if begin is not None:
        D, Jr = exp_and_jacobian(spread(L, begin))
        z, T, B = begin, goals @ D, Jr @ L
    rest, finite = False, True
    for turn in range(MOST_TURNS):
        e, Jt = linearised_by(system, T, B)
        step, sound = project(e[None], Jt[None], z[None], soft_m, turn)
        now = float(np.abs(step[0]).max(initial=0.0))
        trace.append(SolverTurn(float(np.abs(e).max(initial=0.0)), now))
        if not (finite := bool(sound[0])):
            z, T, B = np.zeros(6 * n), goals, L
            break
        rest = bool(settles(np.array(now), np.array(size)))
        z = z + (step[0] if rest else shortened_step(step, L[None])[0])
        D, Jr = exp_and_jacobian(spread(L, z))
        T, B, size = goals @ D, Jr @ L, now
        if rest:
            break
    return NearestGoals(T, z, system.residual(T), Jt, B, np.array(rest), np.array(finite), tuple(trace))


def linearised_by(system: CompactEquations, T: Array, B: Array) -> tuple[Array, Array]:
    """e, (3 c,), [m], at the goals T, and its derivative by z, transposed, (6 n, 3 c).

    Args:
        B: (n, 6, 6) or (n, 6, 6 n): what a change of z makes of the body twist of each goal.
    """
    n = len(T)
    if B.shape[2] == 6:
        e, blocks = system.blocks(T, B)
        return e, system.gathered(blocks)
    e, blocks = system.blocks(T, np.broadcast_to(np.eye(6), (n, 6, 6)))
    return e, np.asarray(B.reshape(6 * n, 6 * n).T @ system.gathered(blocks))
