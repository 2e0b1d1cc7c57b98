"""Sparse linear algebra for the solver of `gauss_newton`: time and memory grow in proportion to the contacts.

Two contacts are coupled in J J^t only if an operation occurs in both. Contacts are reordered so that coupled ones are
close (reverse Cuthill-McKee). If all entries then lie in a narrow band, as in a row of castles, a banded Cholesky
decomposition solves for the multipliers. Otherwise (grids, one part that carries everything) multipliers and z are
solved for together, in the sparse matrix [I J^t; J -mu].
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.linear_step import compute_poses_at, measure_largest_turn
from apo_bench.geometry import Array

WIDE = 240
"""Largest width of a band for which banded Cholesky is used, in rows."""
CROWDED = 2_000_000
"""Most pairs of coupled incidences that are listed."""
_RAISED = (0.0, 1e-13, 1e-12, 1e-11, 1e-10)
"""Regularisation tried in turn, as fractions of the mean diagonal, while rounding makes the matrix indefinite."""
FEW = 100
"""Mean number of contacts coupled by an operation up to which J J^t is formed to find the rank."""
_EIGENVALUE = 2e-15
"""Relative eigenvalue of J J^t below which it is rounding, at a solution."""

_Solver = Callable[[Array, Array, Array], Array]
"""A solver: (diagonal to add (3 c,), blocks (i, 6, 3), right side (3 c,)) -> z (6 n,)."""


@final
@dataclass(frozen=True, eq=False)
class Incidence:
    """The block structure of the Jacobian: i pairs of a contact and an operation that occurs in it."""

    contact: NDArray[np.intp]
    """(i,): the contact of each block."""
    letter: NDArray[np.intp]
    """(i,): its unknown letter, as of `Words.unknown`."""
    operation: NDArray[np.intp]
    """(i,): the operation of each block."""
    c: int
    """Number of contacts."""
    n: int
    """Number of operations."""

    def times(self, blocks: Array, z: Array) -> Array:
        """The product J z, (3 c,), from the transposed blocks of J, (i, 6, 3)."""
        each = np.einsum("iab,ia->ib", blocks, z.reshape(self.n, 6)[self.operation])
        at = 3 * self.contact[:, None] + np.arange(3)
        return np.asarray(np.bincount(at.ravel(), each.ravel(), 3 * self.c), dtype=np.float64)

    def transposed_times(self, blocks: Array, y: Array) -> Array:
        """The product J^t y, (6 n,), from the transposed blocks of J, (i, 6, 3)."""
        each = np.einsum("iab,ib->ia", blocks, y.reshape(self.c, 3)[self.contact])
        at = 6 * self.operation[:, None] + np.arange(6)
        return np.asarray(np.bincount(at.ravel(), each.ravel(), 6 * self.n), dtype=np.float64)

    def matrix(self, blocks: Array) -> Any:
        """J as a sparse matrix, (3 c, 6 n), from its transposed blocks, (i, 6, 3)."""
        from scipy.sparse import csr_array

        rows = np.broadcast_to(3 * self.contact[:, None, None] + np.arange(3), blocks.shape)
        columns = np.broadcast_to(6 * self.operation[:, None, None] + np.arange(6)[:, None], blocks.shape)
        return csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * self.c, 6 * self.n))


def incidence(system: CompactEquations) -> Incidence:
    """The block structure of the Jacobian of a system."""
    contact, letter = system.words.incidence
    return Incidence(contact, letter, system.words.operation[letter], len(system), system.n)


def sparse_solver(where: Incidence) -> _Solver:
    """Choose the solver for z that suits the structure; work that depends on the structure alone is done once."""
    pairs = _pairs(where)
    if pairs is not None:
        first, second = pairs
        order = _near(where, first, second)
        a = order[where.contact[first]]
        b = order[where.contact[second]]
        if 3 * int(np.abs(a - b).max(initial=0)) + 3 <= WIDE:
            return _banded(where, first[a >= b], second[a >= b], order)
    return _together(where)


@final
class SparseStep:
    """The step with sparse matrices, for one observation of many operations."""

    settled = 1e-5, 1e-7  # rounding of thousands of operations is larger

    def __init__(self, system: CompactEquations, observed: Array, L: Array, soft_m: Array | None) -> None:
        self._system = system if system.points.ndim == 3 else system.only(0)
        self._observed = observed
        self._L = L
        self._where = incidence(system)
        self._solve = sparse_solver(self._where)
        self._soft2 = np.zeros(3 * len(system)) if soft_m is None else soft_m * soft_m
        self.e = np.zeros((1, len(self._soft2)))
        self.T = observed
        self.B = L
        self.forms = np.zeros((1, len(system), 4))
        self.sizes = np.zeros((3, 1))
        self._blocks = np.zeros((len(self._where.contact), 6, 3))

    @property
    def Jt(self) -> list[Any]:
        return [self._where.matrix(self._blocks).T]

    def linearise(self, z: Array, rows: NDArray[np.intp]) -> None:
        self.T, self.B = compute_poses_at(self._observed, self._L, z)
        forms, e, contacts, letters = self._system.linearise(self.T[0], self.B[0])
        self.forms, self.e = forms[None], e[None]
        self._blocks = np.swapaxes(contacts[self._where.contact] @ letters[self._where.letter], 1, 2)
        self.sizes[0] = np.abs(e).max(initial=0.0)
        self.sizes[1] = (e * e) @ (self._soft2 == 0.0) / max(len(e), 1)
        self.sizes[2] = np.square(self._blocks).sum() / max(len(e), 1)

    def change(self, z: Array, mu: Array, rows: NDArray[np.intp]) -> tuple[Array, Array, Array]:
        wanted = self._where.times(self._blocks, z[0]) - self.e[0]
        step = self._solve(mu[0] + self._soft2, self._blocks, wanted)[None] - z
        return step, np.abs(step).max(axis=1, initial=0.0), measure_largest_turn(step, self._L)

    def leave_alone(self, which: NDArray[np.bool_]) -> None:
        self._blocks = np.zeros_like(self._blocks)
        self.T = self._observed
        self.B = self._L
        self.e = self._system.residual(self.T)
        self.forms = self._system.forms(self.T)


def sparse_rank(Jt: Any) -> int:
    """The rank of a sparse matrix at a solution: the number of eigenvalues of J J^t above rounding (Sylvester's law of
    inertia).
    """
    from scipy.sparse import block_array, eye_array
    from scipy.sparse.linalg import splu

    if not Jt.nnz:
        return 0
    unknowns, m = Jt.shape
    # The pivots of J J^t - lowest have as many positive signs as J J^t has eigenvalues above `lowest`.
    lowest = _EIGENVALUE * _largest(Jt)
    meets = abs(Jt).sign().sum(axis=1) / 3.0
    if (meets**2).sum() <= FEW * meets.sum():
        K = (Jt.T @ Jt - lowest * eye_array(m)).tocsc()
        sign = 1.0
    else:
        K = block_array([[eye_array(unknowns), Jt], [Jt.T, lowest * eye_array(m)]], format="csc")
        sign = -1.0
    factor = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return int(np.count_nonzero(sign * factor.U.diagonal() > 0.0))


def free_basis(Jt: Any, rounding: float, sure: float) -> Array | None:
    """An orthonormal basis of the directions that no equation constrains, (6 n, f), from a sparse matrix at a solution.

    With R^t R = J^t J, pivoted (Cholesky), columns F of J are independent. A free motion of another column makes them
    follow by -R_FF^-1 R_F. As J^t J squares the condition of J, the result is corrected once by its residual
    (seminormal equations; Bjorck, 1987).

    Args:
        rounding: Pivots below this fraction of the largest entry are zero.
        sure: If a nonzero pivot is below this fraction, the rank is not clear.

    Returns:
        None if the rank is not clear.
    """
    from scipy.linalg import cho_solve, solve_triangular
    from scipy.linalg.lapack import dpstrf

    G = (Jt @ Jt.T).toarray()
    largest = G.diagonal().max()
    R, order, rank, _ = dpstrf(G, tol=rounding * largest)
    if not rank or not R[rank - 1, rank - 1] ** 2 > sure * largest:
        return None
    fixed = order[:rank] - 1  # LAPACK counts from 1
    follows = R[:rank, :rank]
    N = np.zeros((len(G), len(G) - rank))
    N[order[rank:] - 1, np.arange(len(G) - rank)] = 1.0
    N[fixed] = -solve_triangular(follows, R[:rank, rank:], check_finite=False)
    N[fixed] -= cho_solve((follows, False), (Jt @ (Jt.T @ N))[fixed], check_finite=False)
    return np.linalg.qr(N)[0]


def _largest(Jt: Any) -> float:
    """Estimate the largest eigenvalue of J J^t by twenty power iterations from a fixed start."""
    y = np.cos(np.arange(Jt.shape[1]))
    size = 1.0
    for _ in range(20):
        y = Jt.T @ (Jt @ (y / np.linalg.norm(y)))
        size = float(np.linalg.norm(y))
    return size


def _pairs(where: Incidence) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Every ordered pair of blocks that share an operation; None if there are too many."""
    order = np.argsort(where.operation, kind="stable")
    count = np.bincount(where.operation, minlength=where.n)
    if int((count * count).sum()) > CROWDED:
        return None
    begin = np.cumsum(count) - count
    many = count[where.operation[order]]
    first = np.repeat(order, many)
    within = np.arange(len(first)) - np.repeat(np.cumsum(many) - many, many)
    second = order[np.repeat(begin[where.operation[order]], many) + within]
    return first, second


def _near(where: Incidence, first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """The position of each contact in an order that puts coupled contacts close together, (c,)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    meets = csr_array((np.ones(len(first)), (where.contact[first], where.contact[second])), shape=(where.c, where.c))
    place = np.empty(where.c, dtype=np.intp)
    place[reverse_cuthill_mckee(meets, symmetric_mode=True)] = np.arange(where.c)
    return place


def _banded(where: Incidence, first: NDArray[np.intp], second: NDArray[np.intp], place: NDArray[np.intp]) -> _Solver:
    """A solver by banded Cholesky decomposition.

    Args:
        first, second: Pairs of blocks whose product is an entry of J J^t on or below the diagonal.
        place: The position of each contact, (c,).
    """
    from scipy.linalg import solveh_banded

    m = 3 * where.c
    row = 3 * place[where.contact[first]][:, None, None] + np.arange(3)[:, None]
    column = 3 * place[where.contact[second]][:, None, None] + np.arange(3)
    below = row - column
    width = int(below.max(initial=0)) + 1
    wanted = below >= 0
    target = (below * m + column)[wanted]
    placed = (3 * place[:, None] + np.arange(3)).ravel()
    together = _together(where)

    def solve(added: Array, blocks: Array, right: Array) -> Array:
        products = np.swapaxes(blocks, 1, 2)[first] @ blocks[second]
        band = np.bincount(target, products[wanted], width * m).reshape(width, m)
        band[0, placed] += added
        ordered = np.empty(m)
        ordered[placed] = right
        size = float(band[0].mean())
        for more in _RAISED:
            band[0] += more * size
            try:
                y = solveh_banded(band, ordered, lower=True, check_finite=False)
            except np.linalg.LinAlgError:
                continue
            return where.transposed_times(blocks, y[placed])
        return together(added, blocks, right)

    return solve


def _together(where: Incidence) -> _Solver:
    """A solver for z and multipliers together, by sparse LU decomposition."""
    from scipy.sparse import block_array, diags_array, eye_array
    from scipy.sparse.linalg import splu

    def solve(added: Array, blocks: Array, right: Array) -> Array:
        J = where.matrix(blocks)
        K = block_array([[eye_array(6 * where.n), J.T], [J, diags_array(-added)]], format="csc")
        return np.asarray(splu(K).solve(np.concatenate([np.zeros(6 * where.n), right]))[: 6 * where.n])

    return solve
