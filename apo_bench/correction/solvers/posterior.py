"""Uncertainty after a correction: rank of the contacts, free directions, and posterior covariance.

At a solution, singular values of redundant equations or free directions are rounding, so the rank is clear there; at
the observed poses it depends on thresholds. The corrected z is uncertain only within the tangent space of the contact
manifold, and there as much as the observation. With an orthonormal basis N of the null space, cov(z) = N N^t.
"""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgeqp3, dorgqr, dpstrf

from apo_bench.correction.solvers import sparse
from apo_bench.geometry import Array

LARGEST_POSTERIOR = 600
"""Most unknowns for which free directions are computed, since a basis of them is a dense matrix."""
UNCLEAR = (1e-14, 1e-9)
"""Range of squared pivots, relative to the largest: with none inside it, the rank is clear without singular values."""
_TIE = 1e-3
"""Difference of the parts of two axes in a span up to which the first one is preferred."""
_BLOCK = 32
"""Block size of LAPACK routines, in columns."""
RANK_CUT_OFF = 1e-7
"""Relative singular value below which it is rounding, at a solution."""


@final
@dataclass(frozen=True, eq=False)
class Freedom:
    """The directions that contacts fix and leave free at a solution.

    The degrees of freedom of the chi-square test, `Consistency.freedom`, are `rank`, the number of fixed directions.
    """

    rank: int
    """Number of fixed directions."""
    redundant: int
    """Equations, three per contact, that follow from the others."""
    spectral_gap: float
    """The smallest singular value that counts over the largest that does not; infinite if every one counts."""
    free: Array
    """(6 n, 6 n - rank): an orthonormal basis of the free directions, in standard deviations z, by `settle_basis`."""


def compute_freedom(Jt: Any) -> Freedom | None:
    """The fixed and free directions from the transposed Jacobian, (6 n, 3 c), dense or sparse, at a solution.

    None above `LARGEST_POSTERIOR` unknowns.
    """
    unknowns, equations_ = Jt.shape
    if unknowns > LARGEST_POSTERIOR:
        return None
    if not isinstance(Jt, np.ndarray):
        Jt = Jt.toarray()
    if not Jt.size:
        return Freedom(0, equations_, np.inf, np.eye(unknowns))
    # The columns of U behind the rank are an orthonormal basis of what no equation sees.
    U, w, _ = np.linalg.svd(Jt, full_matrices=True)
    rank = int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))
    left = w[rank:].max(initial=0.0)
    gap = float(w[rank - 1] / left) if rank and left > 0.0 else np.inf
    return Freedom(rank, equations_ - rank, gap, settle_basis(U[:, rank:]))


def settle_basis(N: Array) -> Array:
    """The orthonormal basis of a span nearest to coordinate axes (orthogonal Procrustes; Schoenemann, 1966).

    The basis of a null space that a decomposition returns depends on rounding; this one depends on the span alone.

    Args:
        N: (m, f), any orthonormal basis of the span.
    """
    # The axes are those that lie in the span the most, given those before: the pivots of a Cholesky factor of the
    # projection N N^t. Of axes that are as good but for rounding the first is taken.
    m, f = N.shape
    P = N @ N.T
    sooner = np.linspace(1.0, 1.0 - _TIE, m)
    axes = list[int]()
    for _ in range(f):
        i = int((P.diagonal() * sooner).argmax())
        axes.append(i)
        P = P - np.outer(P[:, i], P[i]) / P[i, i]
    # Of all rotations Q the one with the least |N Q - E|, E the axes, is U V^t of N^t E = U W V^t.
    U, _, Vt = np.linalg.svd(N[axes].T)
    return np.asarray(N @ (U @ Vt))


def compute_jacobian_rank(Jt: Any) -> int:
    """The rank of a dense or sparse matrix at a solution; from Cholesky pivots if these are clear, else by singular
    values.
    """
    if not isinstance(Jt, np.ndarray):
        return sparse.sparse_rank(Jt)
    if not Jt.size:
        return 0
    G = Jt @ Jt.T if Jt.shape[0] <= Jt.shape[1] else Jt.T @ Jt
    largest = G.diagonal().max()
    if not largest > 0.0:
        return 0
    # Squares of pivots of G, the largest left first, fall from what counts to rounding; if none lies between, that is
    # the rank, quicker than by singular values.
    R, _, rank, _ = dpstrf(G, tol=UNCLEAR[0] * largest)
    if R[rank - 1, rank - 1] ** 2 > UNCLEAR[1] * largest:
        return int(rank)
    w = np.linalg.svd(Jt, compute_uv=False)
    return int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))


def compute_projections(Jt: Any) -> tuple[list[int], Array | None]:
    """The rank of each of b transposed Jacobians at a solution, and the projection onto its free directions.

    A pivoted QR decomposition (Businger and Golub, 1965) gives an orthonormal basis Q of the columns of Jt. The
    projection is P = 1 - Q Q^t, and cov(z) = P = P P^t. Observations of one assembly mostly agree in the pivot columns,
    so all but the first are decomposed without pivoting.

    Args:
        Jt: (b, 6 n, 3 c), or a list of one sparse matrix.

    Returns:
        b ranks, and projections (b, 6 n, 6 n), or for a sparse matrix an orthonormal basis (1, 6 n, f); None above
        `LARGEST_POSTERIOR` unknowns.
    """
    unknowns = Jt[0].shape[0]
    if unknowns > LARGEST_POSTERIOR:
        return [compute_jacobian_rank(matrix) for matrix in Jt], None
    if not isinstance(Jt, np.ndarray):
        free = sparse.free_basis(Jt[0], *UNCLEAR)
        if free is not None:
            return [unknowns - free.shape[1]], free[None]
        Jt = Jt[0].toarray()[None]
    first, columns = _row_space(Jt[0])
    rank = [len(columns)] * len(Jt)
    if len(Jt) == 1:
        return rank, _across(first)[None]
    J = np.swapaxes(Jt, 1, 2)
    Q, R = np.linalg.qr(np.swapaxes(J[:, columns], 1, 2))
    P = _across(Q)
    # The columns are a basis if they are clearly independent and all other columns depend on them.
    lengths = np.square(np.diagonal(R, axis1=1, axis2=2))
    longest = lengths.max(axis=1, initial=0.0)
    left = np.square(np.delete(J, columns, axis=1) @ P).sum(axis=2).max(axis=1, initial=0.0)
    clear = (lengths.min(axis=1, initial=np.inf) > UNCLEAR[1] * longest) & (left <= UNCLEAR[0] * longest)
    for i in np.flatnonzero(~clear):
        basis, columns = _row_space(Jt[i])
        rank[i] = len(columns)
        P[i] = _across(basis)
    return rank, P


def _across(Q: Array) -> Array:
    """The projections 1 - Q Q^t onto the complement of orthonormal bases, (*, m, r)."""
    P = np.asarray(Q @ np.swapaxes(Q, -1, -2))
    np.negative(P, out=P)
    P.reshape(*Q.shape[:-2], -1)[..., :: Q.shape[-2] + 1] += 1.0
    return P


def _row_space(Jt: Array) -> tuple[Array, NDArray[np.intp]]:
    """An orthonormal basis of the columns of Jt, (6 n, rank), and the indices of `rank` columns that span the same."""
    if not Jt.size:
        return np.zeros((len(Jt), 0)), np.zeros(0, dtype=np.intp)
    QR, order, reflectors, _, _ = dgeqp3(Jt, lwork=2 * Jt.shape[1] + _BLOCK * (Jt.shape[1] + 1))
    lengths = np.square(QR.diagonal())
    rank = int(np.count_nonzero(lengths > UNCLEAR[0] * lengths[0]))
    if rank and not lengths[rank - 1] > UNCLEAR[1] * lengths[0]:
        U, w, _ = np.linalg.svd(Jt, full_matrices=False)
        rank = int(np.count_nonzero(w > RANK_CUT_OFF * w[0]))
        return U[:, :rank], order[:rank] - 1
    return dorgqr(QR[:, :rank], reflectors[:rank], lwork=_BLOCK * max(rank, 1))[0], order[:rank] - 1


def compute_marginals(B: Array, free: Array) -> Array:
    """The posterior covariance of the body twist of each corrected pose, (b, n, 6, 6), [m, rad].

    Args:
        B: (b, n, 6, 6) or (b, n, 6, 6 n), as of `NearestPoses`.
        free: (b, 6 n, f): an orthonormal basis of the free directions, or the projection onto them.
    """
    b, n, _, width = B.shape
    spans = B @ (free[:, None] if width != 6 else free.reshape(b, n, 6, free.shape[2]))
    return np.asarray(spans @ np.swapaxes(spans, -1, -2))
