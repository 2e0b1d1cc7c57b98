"""Contacts with play, as inequality constraints: a vertex may be anywhere between two distances from its plane.

Equations of exact and centred contacts are solved first, which settles their rank. After that every iteration solves a
quadratic program: the shortest z among all that satisfy the linearised equations and inequalities.
Redundant equations would make the active-set solver cycle, so z is written as the shortest solution of the equations
plus a combination of their free directions; only that is the unknown of the program.
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
"""Part of the largest row below which an inequality does not depend on the free directions."""
_EXACT = 1e-10
"""How far the program may violate an inequality, in standard deviations."""
_ITERATIONS = 200
_SETTLED = FALL**60
"""The equations are damped as after so many iterations: they hold already."""
_SLOWEST = 1.0 / 64.0
_GROWS = 1.05
"""The least part of a step that is made, and how much larger that part may be than the one before."""
_TOUCH_M = 1e-9
"""An inequality is active if a vertex is nearer to its bound."""
_HARD = 0
_SOFT = 8
"""What DAQP calls an inequality, and one that may be violated."""


@final
@dataclass(frozen=True, eq=False)
class Inequalities:
    """m inequalities low <= e <= high, one per vertex."""

    system: Equations
    low: Array
    """(m,), [m]."""
    high: Array
    """(m,), [m]."""

    def __len__(self) -> int:
        return len(self.low)

    def among(self, contacts: NDArray[np.bool_]) -> Inequalities:
        """The inequalities of some of the contacts that have any."""
        rows = contacts[self.system.contact]
        return Inequalities(self.system.among(contacts), self.low[rows], self.high[rows])

    def overstepped(self, poses: Array) -> Array:
        """By how much the worst vertex of each contact is beyond its bounds at the poses, [m]; 0 if none is."""
        e = self.system.residual(poses)
        worst = np.zeros(len(self.system.letters))
        np.maximum.at(worst, self.system.contact, np.maximum(self.low - e, e - self.high))
        return worst


def compute_violations(system: Equations, exact: NDArray[np.bool_], inequalities: Inequalities, poses: Array) -> Array:
    """The largest |e| of each contact that is an equation, (c,), [m]; or how far an inequality is violated."""
    gaps = system.gaps(poses)
    if len(inequalities):
        gaps[~exact] = inequalities.overstepped(poses)
    return gaps


def list_contact_demands(
    system: Equations, assembly: Assembly, play_m: float
) -> tuple[Equations, NDArray[np.bool_], Inequalities]:
    """What each contact demands: shifted planes, (c,) whether it is an equation, and the inequalities of the others."""
    low, high = project_round_faces(assembly).intervals(play_m).T
    exact = low == high
    inequalities = bound_contacts(system, exact, low, high)
    if exact.all() and not low.any():
        return system, exact, inequalities
    plane = np.array(system.plane)
    plane[:, 3] -= np.where(exact, low, 0.0)[system.contact]
    return replace(system, plane=plane), exact, inequalities


def bound_contacts(system: Equations, exact: NDArray[np.bool_], low: Array, high: Array) -> Inequalities:
    """The inequalities of contacts that are no equations, (c,), between their distances low and high, (c,), [m]."""
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
        # Where walls will be at that z; the program moves on in the free directions alone, z = nearest + free u.
        ahead = e_wall + J_wall @ (nearest - z)
        u, room = _program(J_wall, free, inequalities.low - ahead, inequalities.high - ahead)
        step = nearest + free @ u - z
        largest = float(np.abs(step).max(initial=0.0))
        trace.append((float(np.abs(e).max(initial=0.0)), largest))
        over = settles(largest, before)
        rest = over and room
        # All of the step where it is the last, so that equations hold to rounding.
        pace = _choose_pace(pace, step, last)
        last = step if rest else shortened_step(step, L)
        z = z + (step if rest else pace * last)
        (T,), (B,) = compute_poses_at(observed, L[None], z[None])
        before = largest
        if over:
            break
    return NearestPoses(T, z, system.residual(T), Jt, B, np.array(rest), np.array(True), system.forms(T), trace)


def _shortest(e: Array, Jt: Array, z: Array) -> Array:
    """The shortest z that satisfies the linearised equations, (6 n,), damped as if they held."""
    if not len(e):
        return np.zeros(len(z))
    m = len(e)
    mu = damping(float(np.square(Jt).sum()) / m, float(e @ e) / m, _SETTLED)
    return np.asarray(shortest_z(Jt.T[None], e[None], z[None], np.full((1, m), mu))[0])


def count_active_directions(Jt: Array, inequalities: Inequalities, nearest: NearestPoses) -> int:
    """How many directions the active inequalities fix beyond the equations.

    Args:
        Jt: (6 n, 3 c), the transposed Jacobian of the equations.
    """
    e, J = inequalities.system.linearise(nearest.poses)
    at = (e <= inequalities.low + _TOUCH_M) | (e >= inequalities.high - _TOUCH_M)
    J = pull_back(J[at].reshape(int(at.sum()), len(nearest.z)), nearest.B)
    return compute_jacobian_rank(np.concatenate([Jt, J.T], axis=1)) - compute_jacobian_rank(Jt) if at.any() else 0


def _choose_pace(pace: float, step: Array, last: Array) -> float:
    """The part of a step to make: all of it, but less where inequalities in turn make steps go to and fro.

    If making the part p of the step before left r of it, making p / (1 - r) would have left nothing (secant rule).
    """
    size = float(last @ last)
    if size == 0.0:
        return 1.0
    wanted = pace / max(1.0 - float(step @ last) / size, 1.0 / _GROWS)
    return min(max(wanted, _SLOWEST), 1.0)


def _program(J: Array, free: Array, low: Array, high: Array) -> tuple[Array, bool]:
    """The shortest u with low <= J free u <= high, and whether there is one (DAQP: Arnstrom, Bemporad, Axehill, 2022).

    Far from a solution linearised inequalities can leave no room where the inequalities themselves do; then they are
    violated by as little as can be.
    """
    import daqp

    # Rows of unit length, so that one tolerance in standard deviations holds for all; walls that do not depend on u go.
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
