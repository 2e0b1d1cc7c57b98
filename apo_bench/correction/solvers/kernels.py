"""The dense work of the solver in loops over numbers, for a compiler; each loop has a twin of a few lines of NumPy.

Nothing is decided here: `gauss_newton` decides how much to damp and when to stop, for both twins. This is plain Python
and imports nothing from the package: Numba (Lam, Pitrou and Seibert, 2015) compiles it at the first correction and
keeps the result while this file stays as it is. Few indices, few statements and no views keep the compilation short.
Arrays are C-contiguous; b observations of one assembly with c contacts, n operations and p parts. What is one matrix
product elsewhere is three loops here.
"""

import math
import os
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]
_SAFE = ("reassoc", "contract", "nsz")
"""Liberties that the compiler may take: sums in another order, but numbers that are not finite stay what they are."""
_SHORT = 9
"""Terms of the series of exp that are enough below one radian."""


class Kernels(NamedTuple):
    """The loops, compiled."""

    linearise: Callable[..., None]
    change: Callable[..., None]


@cache
def kernels() -> Kernels | None:
    """Compile the loops; None where Numba is not installed, or would have to compile again in every process."""
    try:
        from numba import config, njit

        vars(config)["CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", "")  # not what a file in the current folder says
        compiler: Any = njit(fastmath=set(_SAFE), error_model="numpy", cache=True)
        return Kernels(compiler(linearise), compiler(change))
    except (ImportError, RuntimeError):
        return None


def own(x: _Array) -> _Array:
    """Make an array contiguous and writable: the compiled code knows one kind of array."""
    known = x.flags
    return x if known.c_contiguous and known.writeable else np.array(x, dtype=np.float64, order="C")


def linearise(
    words: _Index,
    matrices: _Array,
    plane: _Array,
    points: _Array,
    observed: _Array,
    L: _Array,
    soft2: _Array,
    z: _Array,
    rows: _Index,
    series: _Array,
    adjoints: _Array,
    small: _Array,
    behind: _Array,
    before: _Array,
    T: _Array,
    B: _Array,
    e: _Array,
    J: _Array,
    forms: _Array,
    sizes: _Array,
) -> None:
    """Poses T = T_observed exp(L z), the equations e there and their derivative J by z (Eq. 10), of some observations.

    Args:
        words: (3, c, w): letters, columns and inverse (0 or 1) of `Words`.
        matrices: (2, p + n + 1, 4, 4): `Words.constants`, with inverses; those of operations are overwritten.
        points: (b, c, 3, 4); observed (b, n, 4, 4); L (b, n, 6, 6); z (b, 6 n).
        soft2: (3 c,), the variance of each equation, 0 of those that are demanded.
        rows: Which observations.
        series: `geometry.twist.SERIES`; `adjoints` is `geometry.twist.ADJOINTS`.
        small: (6, 6, 6), zeros, then scratch: xi and coefficients, ad, ad^2, a sum, J_r, exp(xi) - 1, of one pose.
        behind: (w + 1, 3, 4), scratch, what stands behind each letter of one contact times its points; so is before,
            (w + 1, 4), its plane times what stands before.
        T: (b, n, 4, 4), overwritten, as are B (b, n, 6, 6), J_r L, e (b, 3 c), J (b, 3 c, 6 n), forms (b, c, 4),
            n D_a^-1 D_b, and sizes (3, b) as `LinearStep` has them.
    """
    n = observed.shape[1]
    c = len(plane)
    w = words.shape[2]
    first = matrices.shape[1] - 1 - n
    for o in rows:
        for k in range(n):
            # xi = L z, its squared angle, and the coefficients of ad, .., ad^4 in J_r.
            square = 0.0
            for i in range(6):
                t = 0.0
                for j in range(6):
                    t += L[o, k, i, j] * z[o, 6 * k + j]
                small[0, 0, i] = t
                if i > 2:
                    square += t * t
            for j in range(4):
                t = 0.0
                for i in range((_SHORT if square < 1.0 else len(series)) - 1, -1, -1):
                    t = t * square + series[i, 2 + j]
                small[0, 1, j] = t
            # ad, then ad^2 and b + c ad + d ad^2, then J_r = 1 + a ad + (b + c ad + d ad^2) ad^2: the upper three rows.
            # Of a, b; 0, a the lower three are copies, and their zeros stay.
            for i in range(3):
                for j in range(6):
                    t = 0.0
                    for q in range(6):
                        t += small[0, 0, q] * adjoints[q, i, j]
                    small[1, i, j] = t
                    if j < 3:
                        small[1, 3 + i, 3 + j] = t
            for i in range(3):
                for j in range(6):
                    t = 0.0
                    for q in range(6):
                        t += small[1, i, q] * small[1, q, j]
                    small[2, i, j] = t
                    if j < 3:
                        small[2, 3 + i, 3 + j] = t
                    small[3, i, j] = small[0, 1, 2] * small[1, i, j] + small[0, 1, 3] * t
                small[3, i, i] += small[0, 1, 1]
            for i in range(3):
                for j in range(6):
                    t = small[0, 1, 0] * small[1, i, j]
                    for q in range(6):
                        t += small[3, i, q] * small[2, q, j]
                    small[4, i, j] = t
                small[4, i, i] += 1.0
                for j in range(3):
                    small[4, 3 + i, 3 + j] = small[4, i, j]
            for i in range(6):
                for j in range(6):
                    t = 0.0
                    for q in range(6):
                        t += small[4, i, q] * L[o, k, q, j]
                    B[o, k, i, j] = t
            # exp(xi) - 1 = A^t X, with A the upper left block of J_r: T = T_observed + T_observed A^t X, and T^-1.
            for i in range(3):
                for j in range(4):
                    t = 0.0
                    for q in range(3):
                        t += small[4, q, i] * (small[1, q, j] if j < 3 else small[0, 0, q])
                    small[5, i, j] = t
            for i in range(4):
                for j in range(4):
                    t = observed[o, k, i, j]
                    for q in range(3):
                        t += observed[o, k, i, q] * small[5, q, j]
                    T[o, k, i, j] = t
                    matrices[0, first + k, i, j] = t
            for i in range(3):
                t = 0.0
                for j in range(3):
                    matrices[1, first + k, i, j] = T[o, k, j, i]
                    t -= T[o, k, j, i] * T[o, k, j, 3]
                matrices[1, first + k, i, 3] = t
        largest = 0.0
        gaps = 0.0
        squares = 0.0
        for i in range(c):
            last = w
            while last > 0 and words[0, i, last - 1] == first + n:  # padding
                last -= 1
            # behind[j] = F_j+1 .. F_w v of the three points v, and e = n F_1 .. F_w v.
            for r in range(3):
                for q in range(6 * n):
                    J[o, 3 * i + r, q] = 0.0
                for d in range(4):
                    behind[last, r, d] = points[o, i, r, d]
            for j in range(last - 1, -1, -1):
                side = words[2, i, j]
                letter = words[0, i, j]
                for r in range(3):
                    for d in range(4):
                        t = 0.0
                        for q in range(4):
                            t += matrices[side, letter, d, q] * behind[j + 1, r, q]
                        behind[j, r, d] = t
            for r in range(3):
                t = 0.0
                for q in range(4):
                    t += plane[i, q] * behind[0, r, q]
                e[o, 3 * i + r] = t
                largest = max(largest, abs(t))
                gaps += t * t if soft2[3 * i + r] == 0.0 else 0.0
            # before[j] = n F_1 .. F_j = (a, .). A letter T has p behind and a before itself: its rows are
            # (a h, p x a) B of points p with last number h; T^-1 stays on the other side, with the opposite sign.
            for d in range(4):
                before[0, d] = plane[i, d]
            for j in range(last):
                side = words[2, i, j]
                letter = words[0, i, j]
                for d in range(4):
                    t = 0.0
                    for q in range(4):
                        t += before[j, q] * matrices[side, letter, q, d]
                    before[j + 1, d] = t
                k = words[1, i, j]
                if k < n:
                    at, sign = (j, -1.0) if side == 1 else (j + 1, 1.0)
                    for r in range(3):
                        for d in range(3):
                            x = (d + 1) % 3
                            y = (d + 2) % 3
                            shift = sign * behind[at, r, 3] * before[at, d]
                            turn = sign * (behind[at, r, x] * before[at, y] - behind[at, r, y] * before[at, x])
                            for q in range(6):
                                J[o, 3 * i + r, 6 * k + q] += shift * B[o, k, d, q] + turn * B[o, k, 3 + d, q]
            for d in range(4):
                forms[o, i, d] = before[last, d]
            for r in range(3 * i, 3 * i + 3):
                for q in range(6 * n):
                    squares += J[o, r, q] * J[o, r, q]
        sizes[0, o] = largest
        sizes[1, o] = gaps / max(3 * c, 1)
        sizes[2, o] = squares / max(3 * c, 1)


def change(
    J: _Array,
    e: _Array,
    z: _Array,
    L: _Array,
    mu: _Array,
    soft2: _Array,
    rows: _Index,
    R: _Array,
    y: _Array,
    step: _Array,
    largest: _Array,
    angles: _Array,
) -> None:
    """J^t (J J^t + mu + soft2)^-1 (J z - e) - z of some observations, by R R^t = J J^t + mu + soft2 (Cholesky).

    Args:
        J: (b, m, 6 n); e is (b, m), z (b, 6 n), L (b, n, 6, 6).
        mu: (rows,), above zero; soft2 is (m,).
        rows: Which observations.
        R: (m, m), scratch, one over each pivot's root on the diagonal, nothing above it; so is y (m,).
        step: (rows, 6 n), overwritten.
        largest: (rows,), overwritten: its largest component.
        angles: (rows,), overwritten: how far a pose is rotated at most, [rad].
    """
    m = e.shape[1]
    size = z.shape[1]
    for x in range(len(rows)):
        o = rows[x]
        for i in range(m):
            y[i] = -e[o, i]
            for q in range(size):
                y[i] += J[o, i, q] * z[o, q]
        # Contact by contact: J J^t, its factor, and the first substitution. Three rows by three at once, since what is
        # read is used three times then; indices are those of contacts, by which the compiler knows that none is below
        # zero.
        for i in range(m // 3):
            for j in range(i + 1):
                r = 3 * i
                s = 3 * j
                t00 = 0.0
                t01 = 0.0
                t02 = 0.0
                t10 = 0.0
                t11 = 0.0
                t12 = 0.0
                t20 = 0.0
                t21 = 0.0
                t22 = 0.0
                for q in range(size):
                    t00 += J[o, r, q] * J[o, s, q]
                    t01 += J[o, r, q] * J[o, s + 1, q]
                    t02 += J[o, r, q] * J[o, s + 2, q]
                    t10 += J[o, r + 1, q] * J[o, s, q]
                    t11 += J[o, r + 1, q] * J[o, s + 1, q]
                    t12 += J[o, r + 1, q] * J[o, s + 2, q]
                    t20 += J[o, r + 2, q] * J[o, s, q]
                    t21 += J[o, r + 2, q] * J[o, s + 1, q]
                    t22 += J[o, r + 2, q] * J[o, s + 2, q]
                for q in range(s):
                    t00 -= R[r, q] * R[s, q]
                    t01 -= R[r, q] * R[s + 1, q]
                    t02 -= R[r, q] * R[s + 2, q]
                    t10 -= R[r + 1, q] * R[s, q]
                    t11 -= R[r + 1, q] * R[s + 1, q]
                    t12 -= R[r + 1, q] * R[s + 2, q]
                    t20 -= R[r + 2, q] * R[s, q]
                    t21 -= R[r + 2, q] * R[s + 1, q]
                    t22 -= R[r + 2, q] * R[s + 2, q]
                R[r, s] = t00
                R[r, s + 1] = t01
                R[r, s + 2] = t02
                R[r + 1, s] = t10
                R[r + 1, s + 1] = t11
                R[r + 1, s + 2] = t12
                R[r + 2, s] = t20
                R[r + 2, s + 1] = t21
                R[r + 2, s + 2] = t22
                for u in range(3):
                    for v in range(3):
                        t = R[r + u, s + v]
                        for q in range(v):
                            t -= R[r + u, s + q] * R[s + v, s + q]
                        if s + v < r + u:
                            t *= R[s + v, s + v]
                            y[r + u] -= t * y[s + v]
                        elif s + v == r + u:
                            # By rounding alone a pivot would be less than what is added.
                            t = 1.0 / math.sqrt(max(t, 0.0) + mu[x] + soft2[r + u])
                            y[r + u] *= t
                        R[r + u, s + v] = t
        # The second substitution, and J^t y - z.
        for q in range(size):
            step[x, q] = -z[o, q]
        for i in range(m - 1, -1, -1):
            y[i] *= R[i, i]
            for q in range(i):
                y[q] -= R[i, q] * y[i]
            for q in range(size):
                step[x, q] += y[i] * J[o, i, q]
        largest[x] = 0.0
        angles[x] = 0.0
        for k in range(size // 6):
            square = 0.0
            for i in range(6):
                largest[x] = max(largest[x], abs(step[x, 6 * k + i]))
                t = 0.0
                for q in range(6):
                    t += L[o, k, i, q] * step[x, 6 * k + q]
                square += t * t if i > 2 else 0.0
            angles[x] = max(angles[x], math.sqrt(square))


PLAIN = Kernels(linearise, change)
"""The loops as they stand, not compiled."""
