"""The point on the contact manifold that is nearest to what was observed, in the metric of its noise.

The error of an observation is a Gaussian body twist, T_observed = T exp(-xi), of stated covariance L L^t. With
z = L^-1 xi the most likely consistent poses have the shortest z that satisfies the contact equations f(z) = 0. They are
found by projection: with f linearised at z, J z' = J z - f has the shortest solution
z' = J^t (J J^t)^-1 (J z - f); then f is linearised again (Gauss-Newton on the constraint; Nocedal and Wright,
"Numerical Optimization", 18).

Redundant contacts make J J^t singular at the solution and almost singular before it, so no rank is determined on the
way. `mu` is added to the diagonal instead. It falls with the square of the gap, and by a factor at every iteration.
Levenberg-Marquardt then converges quadratically, also where J loses rank (Yamashita and Fukushima, 2001). Rank and free
directions are computed where the solver has converged: there singular values of redundant directions are rounding.

There is one loop, over a batch of observations of one assembly; one observation is a batch of one. A `LinearStep`
states how J is kept and how the linear equations are solved: dense or sparse matrices.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.linear_step import NEXT, SURE, DenseStep, LinearStep, measure_largest_turn
from apo_bench.correction.solvers.sparse import SparseStep
from apo_bench.geometry import Array

MOST_ITERATIONS = 60
"""Most iterations."""
STEP = 1e-7
"""The solver has converged after a step whose components are all below this, in standard deviations."""
DAMPING = 0.05
"""Factor of mu, relative to the mean square of the rows of J times that of the gaps in this unit."""
FALL = 0.3
"""mu is at most `DAMPING` times this to the power of the iteration, so that it cannot hold a gap open."""
SQUARED_GAP_FLOOR = 1e-14
"""Least mu, as a fraction of the mean square of the rows: rounding."""
LARGEST_TURN = 0.25
"""Largest rotation of a pose in one step, [rad]."""
LARGEST_DENSE = 72
"""Number of unknowns above which one observation is solved with sparse matrices."""
SMALLEST = 1e-300
"""Least positive divisor."""


class NearestPoses(NamedTuple):
    """Result of the solver, for a batch of observations, (b, ..), or for one."""

    poses: Array
    """(*, n, 4, 4); the observed ones if a number was not finite on the way."""
    z: Array
    """(*, 6 n): the correction in standard deviations."""
    e: Array
    """(*, 3 c): the residual of every compact equation, [m]."""
    Jt: Any
    """(*, 6 n, 3 c): the derivative of e by z, transposed, [m]; of many operations, a sparse matrix of SciPy."""
    B: Array
    """(*, n, 6, 6): derivative of the body twist at corrected pose k by z_k, J_r(xi) L, [m, rad]; (n, 6, 6 n), by all
    of z, if operations share errors."""
    at_rest: NDArray[np.bool_]
    """(*,): whether the solver converged."""
    finite: NDArray[np.bool_]
    """(*,): whether all numbers stayed finite."""
    forms: Array
    """(*, c, 4): n D_a^-1 D_b of each contact; e of any vertex is its product with the vertex."""
    trace: Sequence[Any]
    """One entry per iteration (of each observation of a batch): the largest |e| of the compact equations before the
    step, [m], and its largest component, in standard deviations."""

    def at(self, i: int) -> NearestPoses:
        """The result of observation i of a batch."""
        return NearestPoses(*[x[i] for x in self])

    def batch(self) -> NearestPoses:
        """The result of one observation as a batch of one."""
        fields: list[Any] = [[x] if hasattr(x, "nnz") else np.asarray(x)[None] for x in self[:-1]]
        fields.append([self.trace])
        return NearestPoses(*fields)


def find_nearest_poses(
    system: CompactEquations,
    poses: Array,
    L: Array,
    soft_m: Array | None = None,
    begin: Array | None = None,
) -> NearestPoses:
    """Find the most likely poses that satisfy the contact equations.

    Args:
        poses: (n, 4, 4), or (b, n, 4, 4), the observed poses, world frame, [m].
        L: (*, n, 6, 6), L L^t the covariance of the body twists, [m, rad]; or (*, n, 6, 6 n), of all of them together.
        soft_m: Standard deviation of every equation, (3 c,), [m], 0 if it must hold: minimises |z|^2 + |e / soft_m|^2.
            None: all must hold.
        begin: (*, 6 n), the correction to start from, in standard deviations; None: none.
    """
    if poses.ndim == 4:
        L = np.broadcast_to(L, (len(poses), *L.shape[-3:]))
        return solve_batch(system, poses, L, soft_m, begin, sparse=False)
    z = None if begin is None else begin[None]
    return solve_batch(system, poses[None], L[None], soft_m, z).at(0)


def solve_batch(
    system: CompactEquations,
    observed: Array,
    L: Array,
    soft_m: Array | None = None,
    begin: Array | None = None,
    sparse: bool | None = None,
) -> NearestPoses:
    """`find_nearest_poses` for a batch: observed (b, n, 4, 4), L (b, n, 6, 6) or (b, n, 6, 6 n).

    Args:
        sparse: Whether to use sparse matrices, for a batch of one without shared errors; None: depends on the size.
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
        step = DenseStep(system, observed, L, soft_m)
    return _nearest(step, z)


def _nearest(step: LinearStep, z: Array) -> NearestPoses:
    """Iterate until all observations converge; converged ones stay unchanged while the others (`going`) continue.

    Args:
        z: (b, 6 n), the start; overwritten.
    """
    b = len(z)
    traces = [list[tuple[float, float]]() for _ in range(b)]
    at_rest = np.zeros(b, dtype=np.bool_)
    finite = np.ones(b, dtype=np.bool_)
    going = list(range(b))
    rows = np.arange(b)
    sure, following = step.settled
    step.linearise(z, rows)
    for iteration in range(MOST_ITERATIONS):
        # Plain numbers of each observation: NumPy would take longer for so few. What is not finite is given up.
        gap_m, gap2, row_size = step.sizes.tolist()
        if not math.isfinite(sum(gap2) + sum(row_size)):
            finite[[o for o in going if not math.isfinite(gap2[o] + row_size[o])]] = False
            going = [o for o in going if finite[o]]
        if not going:
            break
        if len(going) < len(rows):
            rows = np.array(going)
        # The step to the shortest z on the linearised contacts, z' = J^t (J J^t + mu)^-1 (J z - f).
        most = min(1.0, FALL**iteration)
        mu = np.array([damping(row_size[o], gap2[o], most) for o in going])
        change, largest, angles = step.change(z, mu, rows)
        # Rest where the next step would be too short to matter. A step that turns a pose far is shortened, since
        # contacts are linear for small turns only.
        left = []
        for i, (o, size, angle) in enumerate(zip(going, largest.tolist(), angles.tolist(), strict=True)):
            if size < sure and settles(size, traces[o][-1][1] if iteration else math.inf, sure, following):
                at_rest[o] = True
            else:
                left.append(o)
                if angle > LARGEST_TURN:
                    change[i] *= LARGEST_TURN / angle
            traces[o].append((gap_m[o], size))
        going = left
        if len(rows) == b:
            z += change
        else:
            z[rows] += change
        step.linearise(z, rows)
    if not finite.all():
        z[~finite] = 0.0
        step.leave_alone(~finite)
    return NearestPoses(step.T, z, step.e, step.Jt, step.B, at_rest, finite, step.forms, traces)


def damping(row_size: float, gap2: float, most: float) -> float:
    """The damping mu that is added to the diagonal of J J^t.

    Args:
        row_size: The mean square of the rows of J.
        gap2: The mean square of the residuals of the equations that must hold.
        most: Upper limit of gap2 / row_size.
    """
    # Conditional expressions instead of `max` and `min`, which are slower for two numbers.
    size = row_size if row_size > SMALLEST else SMALLEST
    gap = gap2 / size
    share = DAMPING * (gap if gap < most else most)
    mu = size * (share if share > SQUARED_GAP_FLOOR else SQUARED_GAP_FLOOR)
    return mu if mu > SMALLEST else SMALLEST


def settles(size: float, before: float, sure: float = SURE, following: float = NEXT) -> bool:
    """Whether the solver has converged: this step is short, or the next one will be.

    Args:
        size: Largest component of this step, in standard deviations.
        before: That of the step before.
        sure: Steps below this shrink by a constant factor. Longer ones are not trusted, since rounding turns redundant
            contacts into noise there.
        following: Length of the predicted next step, below which the solver has converged.
    """
    return size < STEP or (size < sure and size * size < following * before)


def shortened_step(step: Array, L: Array) -> Array:
    """A step (6 n,), shortened if a pose would turn further than `LARGEST_TURN`."""
    (angle,) = measure_largest_turn(step[None], L[None]).tolist()
    return step * (LARGEST_TURN / angle) if angle > LARGEST_TURN else step
