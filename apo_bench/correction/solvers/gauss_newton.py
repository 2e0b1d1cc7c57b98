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

There is one loop, over a batch of observations of one assembly; one observation is a batch of one. How J is kept and
how the linear equations are solved is said by a `LinearStep`: dense or sparse matrices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.kernels import kernels
from apo_bench.correction.solvers.linear_step import NEXT, SURE, DenseStep, LinearStep, turn_of
from apo_bench.correction.solvers.sparse import SparseStep
from apo_bench.geometry.arrays import Array

MOST_TURNS = 60
STEP = 1e-7
"""The solver rests after a step that is shorter in every component, in standard deviations."""
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
    turns: Array
    """(*, turns, 2): as `SolverTurn` has them; NaN after the last turn of an observation."""

    @property
    def trace(self) -> tuple[SolverTurn, ...]:
        """The turns of one observation; of several, the largest numbers of each turn."""
        turns = self.turns.reshape(-1, *self.turns.shape[-2:])
        going = turns[:, ~np.isnan(turns[..., 1]).all(axis=0)]
        return tuple(SolverTurn(gap, step) for gap, step in np.fmax.reduce(going, axis=0).tolist())

    def at(self, i: int) -> NearestGoals:
        """Those of one observation of a batch."""
        return NearestGoals(*(x[i] for x in self.arrays()))

    def batch(self) -> NearestGoals:
        """Those of one observation as a batch."""
        fields: list[Any] = [[x] if hasattr(x, "nnz") else x[None] for x in self.arrays()]
        return NearestGoals(*fields)

    def arrays(self) -> tuple[Any, ...]:
        """Every field."""
        return self.goals, self.z, self.e, self.Jt, self.B, self.at_rest, self.finite, self.turns


def nearest_goals(
    system: CompactEquations,
    goals: Array,
    L: Array,
    soft_m: Array | None = None,
    begin: Array | None = None,
    compiled: bool = False,
) -> NearestGoals:
    """Change all goals as little as the contacts ask for.

    Args:
        goals: (*, n, 4, 4), what was seen, world frame, [m].
        L: (*, n, 6, 6), L L^t the covariance of the body twists, [m, rad]; or (*, n, 6, 6 n), of all of them together.
        soft_m: None demands the contacts; otherwise the standard deviation of every equation, (3 c,), [m], 0 for those
            that are demanded, and |z|^2 + |e / soft_m|^2 is least.
        begin: (*, 6 n), the correction to begin with, in standard deviations; None stands for no correction.
        compiled: Whether kernels are used where Numba is installed.
    """
    lead = goals.shape[:-3]
    n = system.n
    b = math.prod(lead)
    factor = np.broadcast_to(L, (*lead, *L.shape[-3:])).reshape(b, *L.shape[-3:])
    z = None if begin is None else begin.reshape(b, 6 * n)
    found = batch_goals(system, goals.reshape(b, n, 4, 4), factor, soft_m, z, compiled, sparse=False if lead else None)
    if not lead:
        return found.at(0)
    return found if lead == (b,) else NearestGoals(*(x.reshape((*lead, *x.shape[1:])) for x in found.arrays()))


def batch_goals(
    system: CompactEquations,
    observed: Array,
    L: Array,
    soft_m: Array | None = None,
    begin: Array | None = None,
    compiled: bool = False,
    sparse: bool | None = None,
) -> NearestGoals:
    """`nearest_goals` of a batch: observed (b, n, 4, 4), L (b, n, 6, 6) or (b, n, 6, 6 n).

    Args:
        sparse: Whether matrices are sparse, of a batch of one without shared errors; None leaves that to its size.
    """
    b = len(observed)
    unknowns = 6 * system.n
    z = np.zeros((b, unknowns)) if begin is None else np.array(begin)
    if sparse is None:
        sparse = b == 1 and unknowns > LARGEST_DENSE and L.shape[-1] == 6
    step: LinearStep
    if sparse:
        step = SparseStep(system, observed, L, soft_m)
    else:
        step = DenseStep(system, observed, L, soft_m, kernels() if compiled else None)
    return _nearest(step, z)


def _nearest(step: LinearStep, z: Array) -> NearestGoals:
    """The loop. Observations that rest are left alone while the others, those of number `going`, go on.

    Args:
        z: (b, 6 n), where to begin; overwritten.
    """
    b = len(z)
    count = 0
    at_rest = np.zeros(b, dtype=np.bool_)
    finite = np.ones(b, dtype=np.bool_)
    before = np.full(b, np.inf)
    turns = np.full((MOST_TURNS, b, 2), np.nan)
    going = np.arange(b)
    step.linearise(z, going)
    while len(going) and count < MOST_TURNS:
        row_size = step.row_size[going]
        gap2 = step.gap2[going]
        sound = np.isfinite(row_size + gap2)
        if not sound.all():
            finite[going[~sound]] = False
            going = going[sound]
            row_size = row_size[sound]
            gap2 = gap2[sound]
        if not len(going):
            break
        # The step to the shortest z on the linearised contacts, J J^t damped by mu.
        change, length, turned = step.change(z, damping(row_size, gap2, count), going)
        turns[count, going, 0] = step.gap_m[going]
        turns[count, going, 1] = length
        rest = settles(length, before[going], *step.settled)
        z[going] += _shortened(change, np.where(rest, 0.0, turned))
        step.linearise(z, going)
        at_rest[going] = rest
        before[going] = length
        going = going[~rest]
        count += 1
    if not finite.all():
        z[~finite] = 0.0
        step.leave_alone(~finite)
    return NearestGoals(step.T, z, step.e, step.Jt, step.B, at_rest, finite, np.swapaxes(turns[:count], 0, 1))


def damping(row_size: Array, gap2: Array, turn: int) -> Array:
    """mu, (b,), which is added to the diagonal of J J^t.

    Args:
        row_size: (b,), the mean square of the rows of J.
        gap2: (b,), the mean square of what the equations that are demanded leave.
    """
    size = np.maximum(row_size, SMALLEST)
    share = np.maximum(DAMPING * np.minimum(gap2 / size, min(1.0, FALL**turn)), SQUARED_GAP_FLOOR)
    return np.maximum(share * size, SMALLEST)


def settles(size: Array, before: Array, sure: float = SURE, following: float = NEXT) -> NDArray[np.bool_]:
    """Whether the step after this one is too short to matter: near a solution steps shrink by a constant factor.

    Args:
        sure: Steps shorter than this shrink by a constant factor: the solver rests, too, if the next one would be
            shorter than `following`. Longer ones are not trusted: rounding turns redundant contacts into noise there.
    """
    return np.asarray((size < STEP) | ((size < sure) & (size * size < following * before)))


def shortened_step(step: Array, L: Array) -> Array:
    """Steps (b, 6 n), shortened where a goal of an observation would turn further than `LARGEST_TURN`."""
    return _shortened(step, turn_of(step, L))


def _shortened(step: Array, turned: Array) -> Array:
    """The same of steps of which it is known how far they turn a goal at most, (b,), [rad]."""
    if (turned <= LARGEST_TURN).all():
        return step
    return step * np.minimum(1.0, LARGEST_TURN / np.maximum(turned, SMALLEST))[:, None]
