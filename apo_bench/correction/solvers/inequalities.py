"""Nearest poses with contacts that have play, as inequality constraints on the distances of vertices from planes.

Equations of exact and centred contacts are solved first, which determines their rank. Then every iteration solves a
quadratic program: the shortest z that satisfies the linearised equations and inequalities. Redundant equations would
make the active-set solver cycle. So z is the shortest solution of the equations plus a combination of their free
directions, and only that combination is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Equations, project_round_faces
from apo_bench.correction.solvers.compact import CompactEquations, linearise_by
from apo_bench.correction.solvers.gauss_newton import FALL, NearestPoses, damping, settles, shortened_step
from apo_bench.correction.solvers.linear_step import compute_poses_at, shortest_z
from apo_bench.correction.solvers.posterior import LARGEST_POSTERIOR, compute_jacobian_rank
from apo_bench.correction.solvers.whitened import pull_back
from apo_bench.errors import require
from apo_bench.geometry import Array

_BLIND = 1e-7
"""Relative size of a row below which an inequality does not depend on the free directions."""
_EXACT = 1e-10
"""Largest violation of an inequality by the program, in standard deviations."""
_ITERATIONS = 200
"""Most iterations."""
_SETTLED = FALL**60
"""Damping of the equations, as after 60 iterations of `gauss_newton`, since they hold already."""
_SLOWEST = 1.0 / 64.0
"""Least fraction of a step that is made."""
_GROWS = 1.05
"""Largest ratio of that fraction to the one of the step before."""
_TOUCH_M = 1e-9
"""Distance of a vertex from its bound up to which an inequality is active, [m]."""
_HARD = 0
"""DAQP's code of an inequality that must hold."""
_SOFT = 8
"""DAQP's code of an inequality that may be violated at a cost."""


@final
@dataclass(frozen=True, eq=False)
class Inequalities:
    """m inequalities low <= e <= high, one per vertex."""

    system: Equations
    """The equations whose residuals e are bounded."""
    low: Array
    """(m,), [m]."""
    high: Array
    """(m,), [m]."""

    def __len__(self) -> int:
        return len(self.low)

    def among(self, contacts: NDArray[np.bool_]) -> Inequalities:
        """The inequalities of the chosen contacts, out of those that have any."""
        rows = contacts[self.system.contact]
        return Inequalities(self.system.among(contacts), self.low[rows], self.high[rows])

    def overstepped(self, poses: Array) -> Array:
        """The largest violation of the bounds of each contact at the poses, [m]; 0 if none is violated."""
        e = self.system.residual(poses)
        worst = np.zeros(len(self.system.letters))
        np.maximum.at(worst, self.system.contact, np.maximum(self.low - e, e - self.high))
        return worst


def compute_violations(system: Equations, exact: NDArray[np.bool_], inequalities: Inequalities, poses: Array) -> Array:
    """The largest |e| of each contact, (c,), [m]; for an inequality its violation."""
    gaps = system.gaps(poses)
    if len(inequalities):
        gaps[~exact] = inequalities.overstepped(poses)
    return gaps


def list_contact_demands(
    system: Equations, assembly: Assembly, play_m: float
) -> tuple[Equations, NDArray[np.bool_], Inequalities]:
    """The equations with shifted planes, (c,) whether each contact is an equation, and the inequalities of the
    others.
    """
    low, high = project_round_faces(assembly).intervals(play_m).T
    exact = low == high
    inequalities = bound_contacts(system, exact, low, high)
    if exact.all() and not low.any():
        return system, exact, inequalities
    plane = np.array(system.plane)
    plane[:, 3] -= np.where(exact, low, 0.0)[system.contact]
    return replace(system, plane=plane), exact, inequalities


def bound_contacts(system: Equations, exact: NDArray[np.bool_], low: Array, high: Array) -> Inequalities:
    """The inequalities of the contacts that are no equations, with their least and greatest distances, (c,), [m]."""
    walls = system.among(~exact)
    return Inequalities(walls, low[~exact][walls.contact], high[~exact][walls.contact])


def find_nearest_between(
    system: CompactEquations, inequalities: Inequalities, observed: Array, L: Array, start: NearestPoses
) -> NearestPoses:
    """The nearest poses that satisfy the equations and the inequalities.

    Args:
        observed: (n, 4, 4), what was observed, world frame, [m].
        L: (n, 6, 6) or (n, 6, 6 n), as of `find_nearest_poses`.
        start: The nearest poses without inequalities.

    Returns:
        Not at rest if the inequalities leave no room.

    Raises:
        InputError: Too many operations for a dense program.
    """
    require(
        6 * system.n <= LARGEST_POSTERIOR,
        f"walls with {system.n} operations were given, up to {LARGEST_POSTERIOR // 6} are allowed; "
        'ask for "centred" contacts instead.',
    )
    known = compute_jacobian_rank(start.Jt)
    before = np.inf
    trace = list(start.trace)
    pace = 1.0
    z = start.z
    T = start.poses
    B = start.B
    rest = False
    Jt = start.Jt
    last = np.zeros(len(start.z))
    for _ in range(_ITERATIONS):
        e, Jt = linearise_by(system, T, B)
        # Equations first: the shortest z on them, and what they leave free there, of the rank that is known already.
        nearest = _shortest(e, Jt, z)
        free = np.linalg.svd(Jt)[0][:, known:] if Jt.size else np.eye(len(z))
        e_wall, J_wall = inequalities.system.linearise(T)
        J_wall = pull_back(J_wall.reshape(len(inequalities), -1), B)
        # Residuals of the inequalities at that z; the program then moves in the free directions, z = nearest + free u.
        ahead = e_wall + J_wall @ (nearest - z)
        u, room = _program(J_wall, free, inequalities.low - ahead, inequalities.high - ahead)
        step = nearest + free @ u - z
        largest = float(np.abs(step).max(initial=0.0))
        trace.append((float(np.abs(e).max(initial=0.0)), largest))
        over = settles(largest, before)
        rest = over and room
        # The last step is made in full, so that equations hold to rounding.
        pace = _choose_pace(pace, step, last)
        last = step if rest else shortened_step(step, L)
        z = z + (step if rest else pace * last)
        (T,), (B,) = compute_poses_at(observed, L[None], z[None])
        before = largest
        if over:
            break
    return NearestPoses(T, z, system.residual(T), Jt, B, np.array(rest), np.array(True), system.forms(T), trace)


def _shortest(e: Array, Jt: Array, z: Array) -> Array:
    """The shortest z that satisfies the linearised equations, (6 n,), with little damping."""
    if not len(e):
        return np.zeros(len(z))
    m = len(e)
    mu = damping(float(np.square(Jt).sum()) / m, float(e @ e) / m, _SETTLED)
    return np.asarray(shortest_z(Jt.T[None], e[None], z[None], np.full((1, m), mu))[0])


def count_active_directions(Jt: Array, inequalities: Inequalities, nearest: NearestPoses) -> int:
    """Number of directions that the active inequalities fix beyond the equations.

    Args:
        Jt: (6 n, 3 c), the transposed Jacobian of the equations.
    """
    e, J = inequalities.system.linearise(nearest.poses)
    at = (e <= inequalities.low + _TOUCH_M) | (e >= inequalities.high - _TOUCH_M)
    J = pull_back(J[at].reshape(int(at.sum()), len(nearest.z)), nearest.B)
    return compute_jacobian_rank(np.concatenate([Jt, J.T], axis=1)) - compute_jacobian_rank(Jt) if at.any() else 0


def _choose_pace(pace: float, step: Array, last: Array) -> float:
    """The fraction of a step to make; below 1 where changing active inequalities make steps oscillate.

    If making the fraction p of the last step left the fraction r of it, making p / (1 - r) would have left nothing
    (secant rule).

    Args:
        pace: The fraction of the last step that was made.
        last: The last step.
    """
    size = float(last @ last)
    if size == 0.0:
        return 1.0
    wanted = pace / max(1.0 - float(step @ last) / size, 1.0 / _GROWS)
    return min(max(wanted, _SLOWEST), 1.0)


def _program(J: Array, free: Array, low: Array, high: Array) -> tuple[Array, bool]:
    """The shortest u with low <= J free u <= high, and whether one exists (DAQP: Arnstrom, Bemporad, Axehill, 2022).

    Far from a solution the linearised inequalities may be infeasible though the true ones are not; then they are
    violated as little as possible.
    """
    import daqp

    # Rows are scaled to unit length, so that one tolerance in standard deviations holds for all. Inequalities that do
    # not depend on u are dropped.
    A = J @ free
    size = np.sqrt((A * A).sum(axis=1))
    seeing = size > _BLIND * np.sqrt((J * J).sum(axis=1))
    A = A[seeing] / size[seeing, None]
    low = low[seeing] / size[seeing]
    high = high[seeing] / size[seeing]
    k = A.shape[1]
    if not len(A) or not k:
        return np.zeros(k), True
    problem = np.eye(k), np.zeros(k), np.ascontiguousarray(A), high, low
    u, _, flag, _ = daqp.solve(*problem, np.full(len(A), _HARD, dtype=np.intc), primal_tol=_EXACT)
    if flag > 0:
        return np.asarray(u), True
    u, _, _, _ = daqp.solve(*problem, np.full(len(A), _SOFT, dtype=np.intc), primal_tol=_EXACT)
    return np.asarray(u), False
