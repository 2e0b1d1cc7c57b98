"""The solver of `manifold`, written out in loops over numbers, for a compiler.

The algorithm is that of `manifold.nearest_goals`, with the same constants. Three things differ in how it is calculated:

- J is kept as blocks of 3 x 6, one for each motion parameter in the word of each contact, and J J^t is summed over
  pairs of contacts that share a motion parameter.
- J J^t + mu is factored inside its envelope (George and Liu, "Computer solution of large sparse positive definite
  systems", 1981). J J^t is positive semidefinite, so no pivot is below mu; one that rounding made smaller is raised.
- exp and J_r are put together from 3 x 3 matrices: with W = hat(w) and V = hat(v), the upper right block of ad^k is
  the derivative of W^k along V, and W^3 = -q W.

Everything here is plain Python that runs as it stands, if slowly; `compiled` hands it to Numba, which keeps what it
compiled for as long as this file stays as it is, so nothing is imported from the package. Names are those of
`manifold` and `compact`; arrays are C-contiguous, those behind `out` are overwritten.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]
_Words = tuple[_Index, _Index, _Index]
"""Letters, columns and inverse (0 or 1) of `CompactEquations`, each (c, w)."""
_Rule = tuple[int, float, float, float, float, float, float, float, float]
"""MOST_TURNS, STEP, SURE, NEXT, DAMPING, FALL, SQUARED_GAP_FLOOR, LARGEST_TURN, SMALLEST of `manifold`."""
_SHORT = 9
"""Terms of the series of exp that are enough below one radian."""


def solve_each(
    start: _Array,
    words: _Words,
    plane: _Array,
    points: _Array,
    observed: _Array,
    L: _Array,
    soft_m: _Array,
    series: _Array,
    rule: _Rule,
    out: tuple[_Array, _Array, _Array, _Array, _Array],
    rest: NDArray[np.bool_],
    finite: NDArray[np.bool_],
    trace: _Array,
    ended: _Index,
) -> None:
    """One observation after the other.

    Args:
        points: (b or 1, c, 3, 4).
        seen: (b, n, 4, 4).
        L: (b or 1, n, 6, 6).
        soft_m: (3 c,); (0,) demands every equation.
        series: `geometry.twist.SERIES`.
        out: goals (b, n, 4, 4), z (b, 6 n), e (b, 3 c), Jt (b, 6 n, 3 c), B (b, n, 6, 6), as in `NearestGoals`.
        rest: (b,), overwritten; so is `finite`.
        trace: (b, TURNS, 2), overwritten: the largest |e| and the largest step of each turn.
        ended: (b,), overwritten: the number of turns.
    """
    turns, step_size, sure, next_size, damp, fall, floor, largest_turn, smallest = rule
    b, n, c, w, p = len(observed), observed.shape[1], len(plane), words[0].shape[1], len(start)
    m, soft = 3 * c, len(soft_m) > 0
    width, slot, first, begin, users = ordered(words, p + n, n)
    factors = np.zeros((p + n + 1, 2, 4, 4))
    for k in range(p):
        both(start[k], factors[k])
    blocks, behind, A = np.zeros((c, w, 3, 6)), np.zeros((w + 1, 3, 4)), np.zeros((m, m))
    y, step = np.zeros(m), np.zeros(6 * n)
    for o in range(b):
        T, z, e, B = out[0][o], out[1][o], out[2][o], out[4][o]
        v, Lo = points[o if len(points) > 1 else 0], L[o if len(L) > 1 else 0]
        T[:], z[:], B[:], size = observed[o], 0.0, Lo, np.inf
        for turn in range(turns):
            ended[o] = turn + 1
            for k in range(n):
                both(T[k], factors[p + k])
            linearise(words, width, slot, factors, plane, v, B, e, blocks, behind)
            gram(blocks, first, begin, users, A)
            mean, gap2, total, gap = 0.0, 0.0, 0.0, 0.0
            for i in range(m):
                mean += A[i, i] / m
                total += e[i]
                gap = worse(gap, abs(e[i]))
                if not soft or soft_m[i] == 0.0:
                    gap2 += e[i] * e[i]
            finite[o] = abs(mean + total) < math.inf  # `isfinite` is x - x == x - x, which reordering makes true
            if finite[o]:
                mean = max(mean, smallest)
                mu = max(damp * min(min(gap2 / (m * mean), 1.0), fall**turn), floor) * mean
                for i in range(m):
                    A[i, i] += mu + (soft_m[i] * soft_m[i] if soft else 0.0)
                towards(blocks, words[1], slot, z, e, y)
                factored(A, first, mu)
                substituted(A, first, y)
                back(blocks, words[1], slot, y, z, step)
            else:
                step[:] = np.nan
            before, size = size, 0.0
            for i in range(6 * n):
                size = worse(size, abs(step[i]))
            trace[o, turn, 0], trace[o, turn, 1] = gap, size
            rest[o] = size < step_size or (size < sure and size * size < next_size * before)
            if not finite[o]:
                break
            share = 1.0 if rest[o] else step_share(Lo, step, largest_turn, smallest)
            for i in range(6 * n):
                z[i] += share * step[i]
            for k in range(n):
                displaced(observed[o, k], Lo[k], z[6 * k : 6 * k + 6], series, T[k], B[k])
            if rest[o]:
                break
        scattered(blocks, words[1], slot, out[3][o])
        if not finite[o]:
            T[:], z[:] = observed[o], 0.0
        for k in range(n):
            both(T[k], factors[p + k])
        linearise(words, width, slot, factors, plane, v, B, e, blocks, behind)


def worse(a: float, b: float) -> float:
    """The larger one; what is not a number is larger than any."""
    return b if b > a or math.isnan(b) else a


def ordered(words: _Words, padding: int, n: int) -> tuple[_Index, _Index, _Index, _Index, _Index]:
    """What the words say about where numbers stand.

    Returns:
        width: (c,), letters of each word.
        slot: (c, w), where the block of a letter is kept: that of its motion parameter's first occurrence; or -1.
        first: (c,), the first contact that a contact shares a motion parameter with, its own number if none is before.
        begin: (n + 1,), motion parameter k is in the contacts of number begin[k] .. begin[k + 1] - 1 in `users`.
        users: (*, 2): a contact and its slot.
    """
    letters, columns, _ = words
    c, w = letters.shape
    width, slot, first = np.zeros(c, np.intp), np.full((c, w), -1, np.intp), np.arange(c)
    begin, users, count = np.zeros(n + 1, np.intp), np.zeros((c * w, 2), np.intp), 0
    for i in range(c):
        for j in range(w):
            if letters[i, j] != padding:
                width[i] = j + 1
            for other in range(j, -1, -1):
                if columns[i, j] < n and columns[i, other] == columns[i, j]:
                    slot[i, j] = other
    for k in range(n):
        begin[k] = count
        for i in range(c):
            for j in range(w):
                if columns[i, j] == k and slot[i, j] == j:
                    users[count, 0], users[count, 1] = i, j
                    first[i] = min(first[i], users[begin[k], 0])
                    count += 1
    begin[n] = count
    return width, slot, first, begin, users


def both(T: _Array, out: _Array) -> None:
    """A pose and its inverse, out (2, 4, 4), upper three rows."""
    for i in range(3):
        t = 0.0
        for j in range(3):
            out[0, i, j], out[1, i, j] = T[i, j], T[j, i]
            t += T[j, i] * T[j, 3]
        out[0, i, 3], out[1, i, 3] = T[i, 3], -t


def linearise(
    words: _Words,
    width: _Index,
    slot: _Index,
    factors: _Array,
    plane: _Array,
    points: _Array,
    B: _Array,
    e: _Array,
    blocks: _Array,
    behind: _Array,
) -> None:
    """e, (3 c,), and its derivative, blocks (c, w, 3, 6) as in `CompactEquations`; `behind` (w + 1, 3, 4) scratch."""
    letters, columns, inverse = words
    n = len(B)
    blocks[:] = 0.0
    for i in range(len(plane)):
        behind[width[i]] = points[i]
        for j in range(width[i] - 1, -1, -1):
            F, v = factors[letters[i, j], inverse[i, j]], behind[j + 1]
            for r in range(3):
                for d in range(3):
                    behind[j, r, d] = F[d, 0] * v[r, 0] + F[d, 1] * v[r, 1] + F[d, 2] * v[r, 2] + F[d, 3] * v[r, 3]
                behind[j, r, 3] = v[r, 3]
        a0, a1, a2, h = plane[i, 0], plane[i, 1], plane[i, 2], plane[i, 3]
        for r in range(3):
            v = behind[0]
            e[3 * i + r] = a0 * v[r, 0] + a1 * v[r, 1] + a2 * v[r, 2] + h * v[r, 3]
        for j in range(width[i]):
            F, k = factors[letters[i, j], inverse[i, j]], columns[i, j]
            if inverse[i, j] and k < n:
                added(blocks[i, slot[i, j]], -a0, -a1, -a2, behind[j], B[k])
            b0 = a0 * F[0, 0] + a1 * F[1, 0] + a2 * F[2, 0]
            b1 = a0 * F[0, 1] + a1 * F[1, 1] + a2 * F[2, 1]
            a0, a1, a2 = b0, b1, a0 * F[0, 2] + a1 * F[1, 2] + a2 * F[2, 2]
            if not inverse[i, j] and k < n:
                added(blocks[i, slot[i, j]], a0, a1, a2, behind[j + 1], B[k])


def added(block: _Array, a0: float, a1: float, a2: float, points: _Array, B: _Array) -> None:
    """block (3, 6) += (a h, p x a) B of the points (p, h), (3, 4)."""
    for r in range(3):
        x, y, z, h = points[r, 0], points[r, 1], points[r, 2], points[r, 3]
        t0, t1, t2 = y * a2 - z * a1, z * a0 - x * a2, x * a1 - y * a0
        for q in range(6):
            block[r, q] += t0 * B[3, q] + t1 * B[4, q] + t2 * B[5, q]
        if h != 0.0:
            for q in range(6):
                block[r, q] += h * (a0 * B[0, q] + a1 * B[1, q] + a2 * B[2, q])


def gram(blocks: _Array, first: _Index, begin: _Index, users: _Index, A: _Array) -> None:
    """J J^t, its lower triangle inside the envelope."""
    for i in range(len(first)):
        A[3 * i : 3 * i + 3, 3 * first[i] : 3 * i + 3] = 0.0
    for k in range(len(begin) - 1):
        for x in range(begin[k], begin[k + 1]):
            i, P = users[x, 0], blocks[users[x, 0], users[x, 1]]
            for y in range(begin[k], x + 1):
                j, Q = users[y, 0], blocks[users[y, 0], users[y, 1]]
                for r in range(3):
                    for s in range(3):
                        t = P[r, 0] * Q[s, 0] + P[r, 1] * Q[s, 1] + P[r, 2] * Q[s, 2]
                        A[3 * i + r, 3 * j + s] += t + P[r, 3] * Q[s, 3] + P[r, 4] * Q[s, 4] + P[r, 5] * Q[s, 5]


def towards(blocks: _Array, columns: _Index, slot: _Index, z: _Array, e: _Array, y: _Array) -> None:
    """y = J z - e."""
    for i in range(len(e)):
        y[i] = -e[i]
    for i in range(len(columns)):
        for j in range(columns.shape[1]):
            if slot[i, j] == j:
                for r in range(3):
                    for q in range(6):
                        y[3 * i + r] += blocks[i, j, r, q] * z[6 * columns[i, j] + q]


def factored(A: _Array, first: _Index, mu: float) -> None:
    """A becomes its Cholesky factor, one over each pivot's root on the diagonal; by blocks of 3 x 3, a .. i by rows."""
    for row in range(len(first)):
        r = 3 * row
        for column in range(first[row], row + 1):
            s = 3 * column
            a, b, c = A[r, s], A[r, s + 1], A[r, s + 2]
            d, e, f = A[r + 1, s], A[r + 1, s + 1], A[r + 1, s + 2]
            g, h, i = A[r + 2, s], A[r + 2, s + 1], A[r + 2, s + 2]
            for q in range(3 * max(first[row], first[column]), s):
                x, y, z, u, v, w = A[r, q], A[r + 1, q], A[r + 2, q], A[s, q], A[s + 1, q], A[s + 2, q]
                a, b, c = a - x * u, b - x * v, c - x * w
                d, e, f = d - y * u, e - y * v, f - y * w
                g, h, i = g - z * u, h - z * v, i - z * w
            if column == row:
                a = 1.0 / math.sqrt(max(a, mu))
                d, g = d * a, g * a
                e = 1.0 / math.sqrt(max(e - d * d, mu))
                h = (h - g * d) * e
                i = 1.0 / math.sqrt(max(i - g * g - h * h, mu))
            else:
                a, d, g = a * A[s, s], d * A[s, s], g * A[s, s]
                l, m, n = A[s + 1, s], A[s + 2, s], A[s + 2, s + 1]
                b, e, h = (b - a * l) * A[s + 1, s + 1], (e - d * l) * A[s + 1, s + 1], (h - g * l) * A[s + 1, s + 1]
                c, f = (c - a * m - b * n) * A[s + 2, s + 2], (f - d * m - e * n) * A[s + 2, s + 2]
                i = (i - g * m - h * n) * A[s + 2, s + 2]
                A[r, s + 1], A[r, s + 2], A[r + 1, s + 2] = b, c, f
            A[r, s], A[r + 1, s], A[r + 1, s + 1], A[r + 2, s], A[r + 2, s + 1], A[r + 2, s + 2] = a, d, e, g, h, i


def substituted(A: _Array, first: _Index, y: _Array) -> None:
    """y becomes the solution of the factored equations."""
    for r in range(len(A)):
        t = y[r]
        for q in range(3 * first[r // 3], r):
            t -= A[r, q] * y[q]
        y[r] = t * A[r, r]
    for r in range(len(A) - 1, -1, -1):
        y[r] *= A[r, r]
        for q in range(3 * first[r // 3], r):
            y[q] -= A[r, q] * y[r]


def back(blocks: _Array, columns: _Index, slot: _Index, y: _Array, z: _Array, step: _Array) -> None:
    """step = J^t y - z."""
    for i in range(len(step)):
        step[i] = -z[i]
    for i in range(len(columns)):
        for j in range(columns.shape[1]):
            if slot[i, j] == j:
                for r in range(3):
                    for q in range(6):
                        step[6 * columns[i, j] + q] += blocks[i, j, r, q] * y[3 * i + r]


def step_share(L: _Array, step: _Array, largest_turn: float, smallest: float) -> float:
    """The share of the step at which no goal turns further than `largest_turn`."""
    largest = 0.0
    for k in range(len(L)):
        turned = 0.0
        for i in range(3, 6):
            t = 0.0
            for q in range(6):
                t += L[k, i, q] * step[6 * k + q]
            turned += t * t
        largest = max(largest, turned)
    return min(1.0, largest_turn / max(math.sqrt(largest), smallest))


def displaced(observed: _Array, L: _Array, z: _Array, series: _Array, T: _Array, B: _Array) -> None:
    """T = T_seen exp(xi) and B = J_r(xi) L, with xi = L z."""
    xi = np.zeros(6)
    for i in range(6):
        for j in range(6):
            xi[i] += L[i, j] * z[j]
    v, w = xi[:3], xi[3:]
    square, s = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
    f = np.zeros(6)
    for i in range((_SHORT if square < 1.0 else len(series)) - 1, -1, -1):
        for j in range(6):
            f[j] = f[j] * square + series[i, j]
    W, V = cross_matrix(w), cross_matrix(v)
    R, G, P, S = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            one = 1.0 if i == j else 0.0
            W2, M = w[i] * w[j] - one * square, v[i] * w[j] + w[i] * v[j] - 2.0 * one * s
            R[i, j] = one + (1.0 - square * f[1]) * W[i, j] + f[0] * W2
            G[i, j] = one + f[0] * W[i, j] + f[1] * W2
            a, b = f[2] - square * f[4], f[3] - square * f[5]
            P[i, j] = one + a * W[i, j] + b * W2
            S[i, j] = a * V[i, j] + b * M - 2.0 * s * (f[4] * W[i, j] + f[5] * W2)
    for i in range(3):
        T[i, 3] = observed[i, 3]
        for j in range(3):
            T[i, j] = observed[i, 0] * R[0, j] + observed[i, 1] * R[1, j] + observed[i, 2] * R[2, j]
            T[i, 3] += observed[i, j] * (G[j, 0] * v[0] + G[j, 1] * v[1] + G[j, 2] * v[2])
        for q in range(6):
            B[i, q] = P[i, 0] * L[0, q] + P[i, 1] * L[1, q] + P[i, 2] * L[2, q]
            B[i, q] += S[i, 0] * L[3, q] + S[i, 1] * L[4, q] + S[i, 2] * L[5, q]
            B[i + 3, q] = P[i, 0] * L[3, q] + P[i, 1] * L[4, q] + P[i, 2] * L[5, q]


def cross_matrix(a: _Array) -> _Array:
    """hat(a) b = a x b."""
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -a[2], a[1], -a[0]
    out[1, 0], out[2, 0], out[2, 1] = a[2], -a[1], a[0]
    return out


def scattered(blocks: _Array, columns: _Index, slot: _Index, Jt: _Array) -> None:
    """The transposed Jacobian, (6 n, 3 c)."""
    Jt[:] = 0.0
    for i in range(len(columns)):
        for j in range(columns.shape[1]):
            if slot[i, j] == j:
                for r in range(3):
                    for q in range(6):
                        Jt[6 * columns[i, j] + q, 3 * i + r] = blocks[i, j, r, q]
