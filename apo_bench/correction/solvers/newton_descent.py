"""Newton's method for the shortest correction where the contact equations are strongly curved.

`gauss_newton` steps to the shortest z on the linearised contacts. Its steps shrink by only a percent where the contacts
curve around the observation. An example is a part observed upside down, for which all rotations are about equally far.
Here the second derivative of the Lagrangian |z|^2 / 2 + l f(z) along the free directions gives the step.
"""

from __future__ import annotations

import numpy as np

from apo_bench.correction.solvers.compact import CompactEquations, linearise_by
from apo_bench.correction.solvers.gauss_newton import STEP, shortened_step
from apo_bench.correction.solvers.linear_step import compute_poses_at
from apo_bench.correction.solvers.whitened import whiten_poses
from apo_bench.geometry import Array

_ITERATIONS = 30
"""Most iterations."""
_RANK = 1e-5
"""Relative singular value below which a direction is free; larger than elsewhere, since contacts hold only nearly."""
_APART = 1e-5
"""Step of the finite difference of derivatives, in standard deviations."""
_FLAT = 1e-6
"""Least curvature along a free direction; it is 1 where contacts are not curved."""


def descend_to_nearest(system: CompactEquations, observed: Array, L: Array, poses: Array) -> Array:
    """The nearest consistent poses, (n, 4, 4), starting from consistent ones.

    Args:
        observed: (n, 4, 4), the observed poses, world frame, [m].
        L: (n, 6, 6), L L^t the covariance of the body twists, [m, rad].
        poses: (n, 4, 4), the start.
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
    """The residual e, (b, 3 c), [m], and its transposed derivative by z, (b, 6 n, 3 c), at z, (b, 6 n)."""
    return linearise_by(system, *compute_poses_at(observed, np.broadcast_to(L, (len(z), *L.shape)), z))
