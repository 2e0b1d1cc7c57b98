"""Interface of one linear step of the solver, and its implementation with dense matrices.

The loop of `gauss_newton` is independent of how matrices are stored. It asks a step to linearise the contact equations
at z, and for the shortest z that satisfies the linearised equations.
"""

from typing import Any, Protocol, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.correction.solvers.compact import CompactEquations, linearise_densely
from apo_bench.geometry import Array, compute_exp_and_jacobian

SURE = 1e-6
"""`count_sure_levels` of `gauss_newton.settles` for dense matrices."""
NEXT = 1e-9
"""`following` of `gauss_newton.settles` for dense matrices."""
Rows = NDArray[np.intp]
"""Indices of observations in a batch."""


class LinearStep(Protocol):
    """The contact equations of b observations, linearised at their current z."""

    T: Array
    """(b, n, 4, 4): the current poses."""
    B: Array
    """(b, n, 6, 6) or (b, n, 6, 6 n): derivative of the body twists at T by z."""
    e: Array
    """(b, 3 c): residuals, [m]."""
    forms: Array
    """(b, c, 4): n D_a^-1 D_b of each contact."""
    sizes: Array
    """(3, b): the largest |e|, [m]; the mean square of e of the equations that must hold; the mean square of the rows
    of J."""
    settled: tuple[float, float]
    """`count_sure_levels` and `following` of `gauss_newton.settles`."""

    @property
    def Jt(self) -> Any:
        """The transposed derivative of e by z, (b, 6 n, 3 c)."""

    def linearise(self, z: Array, rows: Rows) -> None:
        """Linearise the observations `rows` at their z; z is that of `rows`."""

    def change(self, z: Array, mu: Array, rows: Rows) -> tuple[Array, Array, Array]:
        """The step from z, of the observations `rows`, to J^t (J J^t + mu + soft^2)^-1 (J z - e).

        Returns:
            The step (rows, 6 n), its largest component (rows,), and its largest rotation of a pose (rows,), [rad].
        """

    def leave_alone(self, which: NDArray[np.bool_]) -> None:
        """Reset some observations, (b,), to their observed poses, with J = 0."""


@final
class DenseStep:
    """The step with dense matrices; errors may be shared."""

    settled = SURE, NEXT

    def __init__(self, system: CompactEquations, observed: Array, L: Array, soft_m: Array | None) -> None:
        b = len(observed)
        m = 3 * len(system)
        self._system = system
        self._observed = observed
        self._L = L
        self._soft2 = np.zeros(m) if soft_m is None else soft_m * soft_m
        self._demanded = (self._soft2 == 0.0) / max(m, 1)
        self.T = observed
        self.B = L
        self.e = np.empty((b, m))
        self.forms = np.empty((b, len(system), 4))
        self._J = np.empty((b, m, 6 * system.n))
        self.sizes = np.empty((3, b))

    @property
    def Jt(self) -> Array:
        return np.swapaxes(self._J, 1, 2)

    def linearise(self, z: Array, rows: Rows) -> None:
        whole = len(rows) == len(self.T)
        some = slice(None) if whole else rows
        T, B = compute_poses_at(self._observed[some], self._L[some], z[some])
        (forms, e, _, _), J = linearise_densely(self._system if whole else self._system.only(rows), T, B)
        squares = np.einsum("bij,bij->b", J, J) / max(e.shape[1], 1)
        sizes = np.array([np.abs(e).max(axis=1, initial=0.0), (e * e) @ self._demanded, squares])
        if whole:
            self.T, self.B, self.forms, self.e, self._J, self.sizes = T, B, forms, e, J, sizes
            return
        self.sizes[:, rows] = sizes
        for kept, made in ((self.T, T), (self.B, B), (self.forms, forms), (self.e, e), (self._J, J)):
            kept[rows] = made

    def change(self, z: Array, mu: Array, rows: Rows) -> tuple[Array, Array, Array]:
        some = slice(None) if len(rows) == len(self.T) else rows
        step = shortest_z(self._J[some], self.e[some], z[some], mu[:, None] + self._soft2) - z[some]
        return step, np.abs(step).max(axis=1, initial=0.0), measure_largest_turn(step, self._L[some])

    def leave_alone(self, which: NDArray[np.bool_]) -> None:
        self.T[which] = self._observed[which]
        self.B[which] = self._L[which]
        self._J[which] = 0.0
        left = self._system.only(np.flatnonzero(which))
        self.e[which] = left.residual(self.T[which])
        self.forms[which] = left.forms(self.T[which])


def shortest_z(J: Array, e: Array, z: Array, added: Array) -> Array:
    """J^t (J J^t + added)^-1 (J z - e), (b, 6 n): the shortest z that satisfies the linearised equations.

    Args:
        J: (b, m, 6 n).
        e: (b, m); so is `added`, above zero, to the diagonal.
    """
    # Push-through: the multipliers of m equations, not 6 n unknowns, so directions that no equation sees stay at zero.
    b, m = e.shape
    Jt = np.swapaxes(J, 1, 2)
    A = J @ Jt
    A.reshape(b, m * m)[:, :: m + 1] += added
    wanted = J @ z[..., None] - e[..., None]
    return np.asarray((Jt @ np.linalg.solve(A, wanted))[..., 0])


def compute_poses_at(observed: Array, L: Array, z: Array) -> tuple[Array, Array]:
    """Poses T = T_observed exp(xi) at xi = L z, (b, n, 4, 4), and B = J_r(xi) L: T(z + d) = T exp(B d + O(d^2)).

    Args:
        observed: (n, 4, 4) or (b, n, 4, 4), [m].
        L: (b, n, 6, 6) or (b, n, 6, 6 n).
        z: (b, 6 n).
    """
    D, Jr = compute_exp_and_jacobian(twists(z, L))
    return observed @ D, Jr @ L


def twists(z: Array, L: Array) -> Array:
    """The twists L z of every operation, (b, n, *), with L (b, n, *, 6) or (b, n, *, 6 n)."""
    width = L.shape[3]
    return np.asarray((L @ z.reshape(len(L), z.shape[1] // width, width, 1))[..., 0])


def measure_largest_turn(step: Array, L: Array) -> Array:
    """The largest rotation of a pose by a step of z, (b, 6 n): (b,), [rad]."""
    rotations = twists(step, L[:, :, 3:])
    return np.asarray(np.sqrt((rotations * rotations).sum(axis=2).max(axis=1, initial=0.0)))
