"""Newton-Raphson with the singular value decomposition, as in the paper (Eq. 12 to 23), re-based at every iteration.

Eq. 12 is J dq = -e, with J = df/dq, and Eq. 14 decomposes J = U W V^t. Eq. 22 inverts the singular values in W that
count and puts 0 for the others, which is W*, so that dq = -V W* U^t e (Eq. 23). Eq. 13 adds dq to q; here the poses
take dq in and q starts at 0 again, since the derivatives of the appendix hold at q = 0 only.

Two numbers that the paper does not give decide whether redundant directions stay where they were observed:

- Radians and metres share one matrix, so the columns of rotations are measured as the way of a point `LENGTH_M` off
  the origin of the part, about half a block. Unscaled columns let rotations dominate, and a cut-off then removes
  directions that the contacts do fix.
- The singular values of redundant directions vanish at consistent poses only. Away from them they grow with the
  noise: about 0.002 of the largest at 2 mm and 1 degree, now and then 0.02, where those that contacts fix stay above
  0.03. `SINGULAR_CUT_OFF` lies between. A descent with a cut-off of 1e-6 closes the gap as well, but parts travel
  centimetres along directions of which the contacts say nothing.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Equations, Iterate, find_largest_residual
from apo_bench.geometry import Array

LENGTH_M = 0.04
"""Length per radian at which a rotation counts as much as a translation."""
SINGULAR_CUT_OFF = 0.02
"""Singular values below this part of the largest one count as zero (w_l+1 .. w_n of Eq. 15, W = diag(w_j))."""
_ITERATIONS = 30
"""Most iterations."""
REST_M = 1e-9
"""Length of a scaled step below which the solver has converged, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Solution:
    """The result of the solver, converged or not."""

    poses: Array
    """(n, 4, 4); the given ones, if a number was not finite on the way."""
    gap_m: float
    """Largest |e| at these poses, [m]."""
    rank: int
    """Number of directions that the equations fix at these poses."""
    at_rest: bool
    """Whether the solver converged."""
    finite: bool
    """Whether all numbers stayed finite."""
    trace: tuple[Iterate, ...]


def solve_newton(
    equations: Equations, poses: Array, free: Collection[int], *, cut_off: float = SINGULAR_CUT_OFF
) -> Solution:
    """Change the free poses as little as possible, until the equations hold or the solver converges.

    The rank at the solution counts. If noise made the rank look larger on the way, the descent is repeated with the
    rank limited to it.

    Args:
        equations: All equations that contain a free motion parameter.
        poses: (n, 4, 4), the start, world frame, [m].
        free: Operations whose motion parameters may change, counted from 0.
        cut_off: Relative singular value below which it counts as zero.
    """
    solution = _descend(equations, poses, free, cut_off)
    if solution.at_rest and any(iterate.rank > solution.rank for iterate in solution.trace):
        again = _descend(equations, poses, free, cut_off, at_most=solution.rank)
        if again.at_rest and again.gap_m <= solution.gap_m + REST_M:
            return again
    return solution


def _descend(
    equations: Equations, poses: Array, free: Collection[int], cut_off: float, at_most: int | None = None
) -> Solution:
    """One descent: each iteration sets T <- T dT(dq), q <- 0.

    Args:
        at_most: Upper limit of the rank; None: the rank that the cut-off gives.
    """
    now = np.array(poses)
    changing = np.array(sorted(free), dtype=np.intp)
    trace = list[Iterate]()
    # Columns of angles are scaled to lengths, so that one cut-off serves all (Eq. 12 with scaled unknowns).
    units = np.array([1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M] * len(changing))
    columns = (6 * changing[:, None] + np.arange(6)).ravel()
    for iteration in range(_ITERATIONS + 1):
        e, J = equations.linearise(now)
        try:
            step, rank = compute_least_step(J[:, columns] / units, e, cut_off, at_most)
        except np.linalg.LinAlgError:
            return Solution(
                np.array(poses), trace[0].gap_m if trace else find_largest_residual(e), 0, False, False, tuple(trace)
            )
        size = float(np.linalg.norm(step))
        trace.append(Iterate(find_largest_residual(e), rank, size))
        if size < REST_M or iteration == _ITERATIONS:
            break
        # T <- T dT(dq), q <- 0: the derivatives of the appendix hold at q = 0 only.
        now[changing] = now[changing] @ displacement((step / units).reshape(-1, 6))
    return Solution(now, trace[-1].gap_m, trace[-1].rank, size < REST_M, True, tuple(trace))


def compute_least_step(J: Array, e: Array, cut_off: float, at_most: int | None = None) -> tuple[Array, int]:
    """The shortest dq with the least |J dq + e|, and the rank (Eq. 15 to 23): dq = -V W* U^t e.

    Raises:
        numpy.linalg.LinAlgError: A number is not finite.
    """
    if not J.size:
        return np.zeros(J.shape[1]), 0
    if not (np.isfinite(e).all() and np.isfinite(J).all()):
        raise np.linalg.LinAlgError("a number is not finite")
    # W* of Eq. 22 inverts the singular values that count, and no others.
    U, w, Vt = np.linalg.svd(J, full_matrices=False)
    rank = min(int(np.count_nonzero(w > cut_off * w[0])), len(w) if at_most is None else at_most)
    return -Vt[:rank].T @ ((U[:, :rank].T @ e) / w[:rank]), rank


def displacement(q: Array) -> Array:
    """dT = P(x, y, z) R_x(alpha) R_y(beta) R_z(gamma) (Eq. 4), (k, 6) -> (k, 4, 4), [m] and [rad]."""
    angles = q[:, 3:].T
    ca, cb, cg = np.cos(angles)
    sa, sb, sg = np.sin(angles)
    dT = np.zeros((len(q), 4, 4))
    dT[:, 0, 0] = cb * cg
    dT[:, 0, 1] = -cb * sg
    dT[:, 0, 2] = sb
    dT[:, 1, 0] = ca * sg + sa * sb * cg
    dT[:, 1, 1] = ca * cg - sa * sb * sg
    dT[:, 1, 2] = -sa * cb
    dT[:, 2, 0] = sa * sg - ca * sb * cg
    dT[:, 2, 1] = sa * cg + ca * sb * sg
    dT[:, 2, 2] = ca * cb
    dT[:, :3, 3] = q[:, :3]
    dT[:, 3, 3] = 1.0
    return dT
