"""The shortest correction where contacts bend as much as the correction is long: Newton's method.

`gauss_newton` takes a step to the shortest z on the linearised contacts. Where these bend about what was observed, as
for a part that was observed upside down, of which every rotation is about as far, its steps shrink by a percent only.
The second derivative of the Lagrangian |z|^2 / 2 + l f(z) along the free directions gives the step there.
"""

from __future__ import annotations

import numpy as np

from apo_bench.correction.solvers.compact import CompactEquations, linearise_by
from apo_bench.correction.solvers.gauss_newton import STEP, shortened_step
from apo_bench.correction.solvers.linear_step import compute_poses_at
from apo_bench.correction.solvers.whitened import whiten_poses
from apo_bench.geometry import Array

_ITERATIONS = 30
_RANK = 1e-5
"""Singular values below this part of the largest one are rounding: the contacts hold almost."""
_APART = 1e-5
"""Standard deviations between two derivatives whose difference is taken."""
_FLAT = 1e-6
"""Curvature along a free direction, at least: 1 where contacts do not bend."""


def descend_to_nearest(system: CompactEquations, observed: Array, L: Array, poses: Array) -> Array:
    """The nearest poses near consistent ones, (n, 4, 4).

    Args:
        observed: (n, 4, 4), what was observed, world frame, [m].
        L: (n, 6, 6), L L^t the covariance of the body twists, [m, rad].
    """
    z = whiten_poses(observed, L, poses)
    for _ in range(_ITERATIONS):
        (e,), (Jt,) = _linearise(system, observed, L, z[None])
        # N spans the free directions; multipliers l solve z + J^t l = 0 in the others, and `towards` closes e there.
        U, w, Vt = np.linalg.svd(Jt)
        rank = int(np.count_nonzero(w > _RANK * w[0]))
        N = U[:, rank:]
        U = U[:, :rank]
        w = w[:rank]
        Vt = Vt[:rank]
        multipliers = -Vt.T @ (U.T @ z / w)
        towards = -U @ (Vt @ e / w)
        # The Lagrangian's second derivative along N, 1 + sum l_i f_i'': f'' N as a difference of two derivatives.
        _, beside = _linearise(system, observed, L, z + _APART * N.T)
        bent = N + ((beside - Jt) @ multipliers).T / _APART
        # Newton's step along N, downhill whatever the sign of a curvature.
        curvature, axes = np.linalg.eigh((N.T @ bent + bent.T @ N) / 2.0)
        slope = axes.T @ (N.T @ z + bent.T @ towards)
        step = towards - N @ (axes @ (slope / np.maximum(np.abs(curvature), _FLAT)))
        z = z + shortened_step(step, L)
        if np.abs(step).max() < STEP:
            break
    return compute_poses_at(observed, L[None], z[None])[0][0]


def _linearise(system: CompactEquations, observed: Array, L: Array, z: Array) -> tuple[Array, Array]:
    """e, (b, 3 c), [m], and its derivative by z, (b, 6 n), transposed, (b, 6 n, 3 c)."""
    return linearise_by(system, *compute_poses_at(observed, np.broadcast_to(L, (len(z), *L.shape)), z))
