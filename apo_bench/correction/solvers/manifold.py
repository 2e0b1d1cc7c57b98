"""The point on the contact manifold that is nearest to what was seen, in the metric of its noise.

What was seen is wrong by a Gaussian body twist, T_seen = T exp(-xi), of stated covariance L L^t, so with z = L^-1 xi
the most likely consistent goals are those with the shortest z among all that satisfy the contact equations f(z) = 0.
They are found by projection: with f linearised at z, J z' = J z - f has the shortest solution
z' = J^t (J J^t)^-1 (J z - f); then f is linearised again (Gauss-Newton on the constraint; Nocedal and Wright,
"Numerical Optimization", 18).

Redundant contacts make J J^t singular at the solution and almost singular before it, so no rank is decided on the way.
`mu` is added to the diagonal instead; it falls with the square of the gap (Levenberg-Marquardt as of Yamashita and
Fukushima, 2001, converges quadratically then, also where J loses rank), and by a factor at every turn. Rank and free
directions are read off where the solver rests: there singular values of redundant directions are rounding.

Leading axes stand for many observations of one assembly, solved at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.twist import exp_and_jacobian

MOST_TURNS = 60
STEP = 1e-7
"""The solver rests after a step that is shorter in every component, in standard deviations."""
SURE, NEXT = 1e-6, 1e-9
"""Steps shorter than the first shrink by a constant factor: it rests, too, if the next one would be shorter than the
second. Longer ones are not trusted, since rounding turns redundant contacts into noise there."""
DAMPING = 0.05
"""mu, per mean square of the rows of J and per mean square of the gaps in that unit."""
FALL = 0.3
"""mu is at most `DAMPING` times this to the number of turns, so that it cannot hold a gap open."""
SQUARED_GAP_FLOOR = 1e-14
"""mu is at least this part of the mean square of the rows: rounding."""
LARGEST_TURN = 0.25
"""[rad]. No goal turns further in one step."""
LARGEST_DENSE = 72
"""Unknowns above which one observation is solved with sparse matrices."""
SMALLEST = 1e-300


class SolverTurn(NamedTuple):
    """One turn of the solver: the largest |e| before it, [m], and the length of its step, in standard deviations."""

    gap_m: float
    step: float


@final
@dataclass(frozen=True, eq=False)
class NearestGoals:
    """The result of the solver, for each observation."""

    goals: Array
    """(*, n, 4, 4); the seen ones, if a number was not finite on the way."""
    z: Array
    """(*, 6 n): the correction in standard deviations."""
    e: Array
    """(*, 3 c): what is left of every compact equation, [m]."""
    Jt: Any
    """(*, 6 n, 3 c): the derivative of e by z, transposed, [m]; of many operations, a sparse matrix of SciPy."""
    B: Array
    """(*, n, 6, 6): what a change of z_k makes of the body twist at the corrected goal k: J_r(xi) L, [m, rad]; where
    operations share errors (n, 6, 6 n), of all of z."""
    at_rest: NDArray[np.bool_]
    """(*,)."""
    finite: NDArray[np.bool_]
    """(*,)."""
    trace: tuple[SolverTurn, ...]
    """The turns of the observation that took longest."""


def nearest_goals(
    system: CompactEquations, goals: Array, L: Array, soft_m: Array | None = None, begin: Array | None = None
) -> NearestGoals:
    """Change all goals as little as the contacts ask for.

    Args:
        goals: (*, n, 4, 4), what was seen, world frame, [m].
        L: (*, n, 6, 6), L L^t the covariance of the body twists, [m, rad]; of one observation also (n, 6, 6 n), of all
            of them together.
        soft_m: None demands the contacts; otherwise the standard deviation of every equation, (3 c,), [m], 0 for those
            that are demanded, and |z|^2 + |e / soft_m|^2 is least.
        begin: (*, 6 n), the correction to begin with, in standard deviations; None stands for no correction.
    """
    lead, n = goals.shape[:-3], system.n
    if L.shape[-1] != 6:
        from apo_bench.correction.solvers.joint import nearest_goals_joint

        return nearest_goals_joint(system, goals, L, soft_m, begin)
    if not lead and 6 * n > LARGEST_DENSE:
        from apo_bench.correction.solvers.large import nearest_goals_sparse

        return nearest_goals_sparse(system, goals, L, soft_m, begin)
    b = math.prod(lead)
    observed = goals.reshape(b, n, 4, 4)
    scale = np.broadcast_to(L, (*lead, n, 6, 6)).reshape(b, n, 6, 6)
    found = _many(system, observed, scale, soft_m, None if begin is None else begin.reshape(b, 6 * n))
    if lead == (b,):
        return found
    names = ("goals", "z", "e", "Jt", "B", "at_rest", "finite")
    shaped = {name: getattr(found, name) for name in names}
    return NearestGoals(**{name: x.reshape((*lead, *x.shape[1:])) for name, x in shaped.items()}, trace=found.trace)


def _many(
    system: CompactEquations, observed: Array, L: Array, soft_m: Array | None, begin: Array | None
) -> NearestGoals:
    """(b, n, 4, 4) goals; observations that rest are left alone while the others go on."""
    b, n = len(observed), system.n
    z, T, B = np.zeros((b, 6 * n)), observed, L
    if begin is not None:
        D, Jr = exp_and_jacobian((L @ begin.reshape(b, n, 6, 1))[..., 0])
        z, T, B = begin, observed @ D, Jr @ L
    now = _Going(np.arange(b), system, observed, L, T, B, z, np.full(b, np.inf))
    done, trace = list[tuple[NDArray[np.intp], tuple[Any, ...]]](), list[SolverTurn]()
    for turn in range(MOST_TURNS):
        e, blocks = now.system.blocks(now.T, now.B)
        Jt = now.system.gathered(blocks)
        step, finite = project(e, Jt, now.z, soft_m, turn)
        size = np.abs(step).max(axis=1, initial=0.0)
        trace.append(SolverTurn(float(np.abs(e).max(initial=0.0)), float(size.max(initial=0.0))))
        rest = finite & settles(size, now.size)
        over = ~finite | rest if turn + 1 < MOST_TURNS else np.ones(b, dtype=np.bool_)[now.which]
        z = now.z + (step if rest.all() else shortened_step(step, now.L))
        D, Jr = exp_and_jacobian((now.L @ z.reshape(len(z), n, 6, 1))[..., 0])
        now = now._replace(z=z, T=now.observed @ D, B=Jr @ now.L, size=size)
        if over.any() or not b:
            ended = (now.T, z, Jt, now.B, rest, finite)
            if over.all():
                done.append((now.which, ended))
                break
            done.append((now.which[over], tuple(x[over] for x in ended)))
            now = now.only(~over)
    return _sorted(system, observed, done, tuple(trace))


def settles(size: Array, before: Array, sure: float = SURE, following: float = NEXT) -> NDArray[np.bool_]:
    """Whether the step after this one is too short to matter: near a solution steps shrink by a constant factor."""
    return np.asarray((size < STEP) | ((size < sure) & (size * size < following * before)))


class _Going(NamedTuple):
    """Observations that do not rest yet."""

    which: NDArray[np.intp]
    system: CompactEquations
    observed: Array
    L: Array
    T: Array
    B: Array
    z: Array
    size: Array
    """(b,), of the step before."""

    def only(self, kept: NDArray[np.bool_]) -> _Going:
        rest = (x[kept] for x in (self.observed, self.L, self.T, self.B, self.z, self.size))
        return _Going(self.which[kept], self.system.only(kept), *rest)


def _sorted(
    system: CompactEquations,
    observed: Array,
    done: list[tuple[NDArray[np.intp], tuple[Any, ...]]],
    trace: tuple[SolverTurn, ...],
) -> NearestGoals:
    """What ended at different turns, in the order of the observations."""
    if len(done) == 1:
        T, z, Jt, B, rest, finite = done[0][1]
    else:
        order = np.argsort(np.concatenate([which for which, _ in done]))
        T, z, Jt, B, rest, finite = (np.concatenate(x)[order] for x in zip(*(x for _, x in done), strict=True))
    if not finite.all():
        T, z = np.where(finite[:, None, None, None], T, observed), np.where(finite[:, None], z, 0.0)
    return NearestGoals(T, z, system.residual(T), Jt, B, rest, finite, trace)


def project(e: Array, Jt: Array, z: Array, soft_m: Array | None, turn: int) -> tuple[Array, NDArray[np.bool_]]:
    """The step to the shortest z that satisfies the linearised equations, (b, 6 n), and whether it is finite, (b,)."""
    b, m = e.shape
    if m == 0:
        return -z, np.ones(b, dtype=np.bool_)
    J = np.swapaxes(Jt, 1, 2)
    A = J @ Jt
    diagonal = A.reshape(b, m * m)[:, :: m + 1]
    size = diagonal.sum(axis=1) / m
    demanded = e if soft_m is None else e * (soft_m == 0.0)
    gap2 = (demanded * demanded).sum(axis=1) / m
    finite = np.isfinite(size + gap2)
    if not finite.all():
        A[~finite], size[~finite] = 0.0, 1.0
    size = np.maximum(size, SMALLEST)
    diagonal += (damping(gap2 / size, turn) * size)[:, None]
    if soft_m is not None:
        diagonal += soft_m * soft_m
    wanted = J @ z[..., None] - e[..., None]
    return (Jt @ np.linalg.solve(A, wanted))[..., 0] - z, finite


def damping(gap2: Array, turn: int) -> Array:
    """mu as a part of the mean square of the rows of J; `gap2` is the mean e^2 in that unit."""
    return np.maximum(DAMPING * np.minimum(np.minimum(gap2, 1.0), FALL**turn), SQUARED_GAP_FLOOR)


def shortened_step(step: Array, L: Array) -> Array:
    """A step, shortened where a goal of an observation would turn further than `LARGEST_TURN`."""
    turned = (L[:, :, 3:] @ step.reshape(len(L), -1, L.shape[3], 1))[..., 0]
    largest = np.sqrt((turned * turned).sum(axis=2).max(axis=1, initial=0.0))
    if (largest <= LARGEST_TURN).all():
        return step
    return step * np.minimum(1.0, LARGEST_TURN / np.maximum(largest, SMALLEST))[:, None]
