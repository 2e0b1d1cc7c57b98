"""What is still uncertain after a correction: the rank of the contacts, the free directions, the posterior covariance.

At a solution, singular values of the Jacobian that belong to redundant equations or free directions are rounding, so
the rank is beyond doubt there, where it is a matter of thresholds at what was seen. The corrected z is uncertain
within the tangent space of the contact manifold only, and there as much as the observation was: with an orthonormal
basis N of the null space, cov(z) = N N^t.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from scipy.linalg.lapack import dpstrf

from apo_bench.correction.solvers import sparse
from apo_bench.correction.solvers.manifold import NearestGoals
from apo_bench.correction.solvers.whitened import spread
from apo_bench.geometry.arrays import Array

LARGEST_POSTERIOR = 600
"""Unknowns above which free directions are not spelled out: a basis of them is a dense matrix."""
UNCLEAR = (1e-14, 1e-9)
"""Squares of pivots, in parts of the largest: with none between these, rounding is told from rank quickly."""
RANK_CUT_OFF = 1e-7
"""Singular values below this part of the largest one are rounding, at a solution."""


@final
@dataclass(frozen=True, eq=False)
class Freedom:
    """What the contacts fix and leave free at one solution."""

    rank: int
    """Directions that the contacts fix."""
    redundant: int
    """Equations, three per contact, that follow from the others."""
    spectral_gap: float
    """The smallest singular value that counts over the largest that does not; infinite if every one counts."""
    free: Array
    """(6 n, 6 n - rank): an orthonormal basis of the free directions, in standard deviations z."""


def freedom(Jt: Any) -> Freedom | None:
    """Read off the transposed Jacobian (6 n, 3 c) at a solution, dense or sparse.

    None above `LARGEST_POSTERIOR` unknowns.
    """
    unknowns, equations_ = Jt.shape
    if unknowns > LARGEST_POSTERIOR:
        return None
    if not isinstance(Jt, np.ndarray):
        Jt = Jt.toarray()
    if not Jt.size:
        return Freedom(0, equations_, np.inf, np.eye(unknowns))
    U, w, _ = np.linalg.svd(Jt, full_matrices=True)
    rank = int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))
    left = w[rank:].max(initial=0.0)
    gap = float(w[rank - 1] / left) if rank and left > 0.0 else np.inf
    return Freedom(rank, equations_ - rank, gap, U[:, rank:])


def jacobian_rank(Jt: Any) -> int:
    """The rank alone, of a dense or a sparse matrix; from the pivots of a Cholesky factor where they are clear."""
    if not isinstance(Jt, np.ndarray):
        return sparse.sparse_rank(Jt)
    if not Jt.size:
        return 0
    G = Jt @ Jt.T if Jt.shape[0] <= Jt.shape[1] else Jt.T @ Jt
    largest = G.diagonal().max()
    if not largest > 0.0:
        return 0
    R, _, found, _ = dpstrf(G, tol=UNCLEAR[0] * largest)
    if R[found - 1, found - 1] ** 2 > UNCLEAR[1] * largest:
        return int(found)
    w = np.linalg.svd(Jt, compute_uv=False)
    return int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))


def marginals(found: NearestGoals, free: Array) -> Array:
    """The posterior covariance of the body twist of each corrected goal, (n, 6, 6), [m, rad]."""
    spans = spread(found.B, free)
    return np.asarray(spans @ np.swapaxes(spans, 1, 2))
