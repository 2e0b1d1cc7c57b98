"""What is around the solver in loops over numbers, for a compiler: vertices and noise; gaps, rank, posterior.

Plain Python that runs as it stands, as `loops` does, and like it imports nothing from the package: `compiled` keeps
what it compiled for as long as this file stays as it is. Arrays are C-contiguous; b observations of one assembly with
c contacts, m vertices, n operations and p parts. Names of fields are those of `assembly.equations.Pattern`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]
_Faces = tuple[_Array, _Array, _Array, _Array, _Index, _Index]
"""Constant poses (p, 4, 4), plane (c, 4), onto (c, 4), corners (m, 4), begin (c + 1,), laid (c,)."""
_Words = tuple[_Index, _Index]
"""Letters and inverse (0 or 1), each (c, w)."""


def prepared(
    faces: _Faces,
    words: _Words,
    moments: _Array,
    goals: _Array,
    covariance: _Array,
    vertex: _Array,
    points: _Array,
    L: _Array,
    before: _Array,
    definite: NDArray[np.bool_],
) -> None:
    """Lay vertices onto faces at the goals that were seen, factor the noise, and measure the gaps.

    Args:
        moments: (c, 3, 4): what stands for the corners of each contact, in the frame that these are in.
        goals: (b, n, 4, 4).
        covariance: (b, n, 6, 6).
        vertex: (b, m, 3), overwritten: frame of the environment part, [m].
        points: (b, c, 3, 4), overwritten: as `CompactEquations.points`.
        L: (b, n, 6, 6), zeros before: L L^t is the covariance.
        before: (b,), overwritten: the largest |e| of all contacts, [m].
        definite: (b,), overwritten: whether every covariance is positive definite.
    """
    start, plane, onto, corners, begin, laid = faces
    M = np.zeros((3, 4))
    for o in range(len(goals)):
        before[o], definite[o] = 0.0, True
        for i in range(len(plane)):
            product(words, i, start, goals[o], M)
            for k in range(begin[i], begin[i + 1]):
                for d in range(3):
                    vertex[o, k, d] = corners[k, d]
                if laid[i]:
                    dropped(M, onto[i], 1.0, vertex[o, k])
            for r in range(3):
                for d in range(4):
                    points[o, i, r, d] = moments[i, r, d]
                if laid[i]:
                    dropped(M, onto[i], moments[i, r, 3], points[o, i, r])
            before[o] = largest(before[o], plane[i], M, vertex[o, begin[i] : begin[i + 1]])
        for k in range(len(goals[o])):
            definite[o] &= rooted(covariance[o, k], L[o, k])


def rated(
    faces: _Faces,
    words: _Words,
    vertex: _Array,
    goals: _Array,
    Jt: _Array,
    B: _Array,
    unclear: tuple[float, float],
    after: _Array,
    cosine: _Array,
    rank: _Index,
    clear: NDArray[np.bool_],
    covariance: _Array,
) -> None:
    """What a solution leaves: gaps, whether faces oppose, the rank of its contacts, how uncertain its goals still are.

    An orthonormal basis Q of the row space of J comes from Gram and Schmidt, the longest row that is left next, each
    direction made orthogonal twice (Giraud et al., 2005). What is free is all else: cov(z) = P = 1 - Q^t Q
    = P P^t.

    Args:
        goals: (b, n, 4, 4), Jt (b, 6 n, 3 c) and B (b, n, 6, 6) as in `NearestGoals`.
        unclear: Squared lengths in parts of the largest; a row that is left between them makes the rank unclear.
        after: (b,), overwritten: the largest |e| of all contacts, [m].
        cosine: (b,), overwritten: the largest between the normals of two faces that touch, -1 of no contacts.
        rank: (b,), overwritten.
        clear: (b,), overwritten: whether rank and covariance can be relied on.
        covariance: (b, n, 6, 6), overwritten: of the body twist at each goal.
    """
    start, plane, onto, _, begin, _ = faces
    size, m = Jt.shape[1], Jt.shape[2]
    M, W, Q = np.zeros((3, 4)), np.zeros((m, size)), np.zeros((size, size))
    P, K = np.zeros((size, size)), np.zeros((6, size))
    for o in range(len(goals)):
        after[o], cosine[o] = 0.0, -1.0
        for i in range(len(plane)):
            product(words, i, start, goals[o], M)
            cosine[o] = max(cosine[o], between(plane[i], M, onto[i]))
            after[o] = largest(after[o], plane[i], M, vertex[o, begin[i] : begin[i + 1]])
        for q in range(size):
            for r in range(m):
                W[r, q] = Jt[o, q, r]
        rank[o], clear[o] = spanned(W, unclear[0], unclear[1], Q)
        for i in range(size):
            for j in range(size):
                P[i, j] = 1.0 if i == j else 0.0
            for r in range(rank[o]):
                for j in range(size):
                    P[i, j] -= Q[r, i] * Q[r, j]
        for k in range(len(B[o])):
            spread(B[o, k], P[6 * k : 6 * k + 6], K, covariance[o, k])


def spread(B: _Array, P: _Array, K: _Array, C: _Array) -> None:
    """C = B P P^t B^t, (6, 6), never negative in any direction; P (6, 6 n), scratch K of the same shape."""
    size = P.shape[1]
    for i in range(6):
        for j in range(size):
            K[i, j] = 0.0
        for q in range(6):
            for j in range(size):
                K[i, j] += B[i, q] * P[q, j]
        for j in range(i + 1):
            t = 0.0
            for q in range(size):
                t += K[i, q] * K[j, q]
            C[i, j], C[j, i] = t, t


def product(words: _Words, i: int, start: _Array, goals: _Array, M: _Array) -> None:
    """M = D_a^-1 D_b of contact i, its upper three rows."""
    letters, inverse = words
    p, n = len(start), len(goals)
    for r in range(3):
        for d in range(4):
            M[r, d] = 1.0 if r == d else 0.0
    for j in range(letters.shape[1] - 1, -1, -1):
        letter = letters[i, j]
        if letter < p + n:
            F = start[letter] if letter < p else goals[letter - p]
            for d in range(4):
                x, y, z = M[0, d], M[1, d], M[2, d]
                if inverse[i, j]:
                    if d == 3:
                        x, y, z = x - F[0, 3], y - F[1, 3], z - F[2, 3]
                    for r in range(3):
                        M[r, d] = F[0, r] * x + F[1, r] * y + F[2, r] * z
                else:
                    for r in range(3):
                        M[r, d] = F[r, 0] * x + F[r, 1] * y + F[r, 2] * z
                        if d == 3:
                            M[r, d] += F[r, 3]


def dropped(M: _Array, plane: _Array, weight: float, v: _Array) -> None:
    """A point, homogeneous with this last number, taken back through M and dropped onto a plane there."""
    x, y, z = v[0] - weight * M[0, 3], v[1] - weight * M[1, 3], v[2] - weight * M[2, 3]
    a = M[0, 0] * x + M[1, 0] * y + M[2, 0] * z
    b = M[0, 1] * x + M[1, 1] * y + M[2, 1] * z
    c = M[0, 2] * x + M[1, 2] * y + M[2, 2] * z
    off = plane[0] * a + plane[1] * b + plane[2] * c + plane[3] * weight
    v[0], v[1], v[2] = a - off * plane[0], b - off * plane[1], c - off * plane[2]


def largest(known: float, plane: _Array, M: _Array, vertex: _Array) -> float:
    """The largest |e| of the vertices of a contact, if it is larger than the one that is known, or not a number."""
    a0 = plane[0] * M[0, 0] + plane[1] * M[1, 0] + plane[2] * M[2, 0]
    a1 = plane[0] * M[0, 1] + plane[1] * M[1, 1] + plane[2] * M[2, 1]
    a2 = plane[0] * M[0, 2] + plane[1] * M[1, 2] + plane[2] * M[2, 2]
    h = plane[0] * M[0, 3] + plane[1] * M[1, 3] + plane[2] * M[2, 3] + plane[3]
    for k in range(len(vertex)):
        e = abs(a0 * vertex[k, 0] + a1 * vertex[k, 1] + a2 * vertex[k, 2] + h)
        if e > known or math.isnan(e):
            known = e
    return known


def between(plane: _Array, M: _Array, onto: _Array) -> float:
    """The cosine between the normals of the two faces of a contact."""
    t = 0.0
    for r in range(3):
        for d in range(3):
            t += plane[r] * M[r, d] * onto[d]
    return t


def rooted(C: _Array, L: _Array) -> bool:
    """L L^t = C, (6, 6), its lower triangle; whether that is so."""
    for i in range(6):
        for j in range(i + 1):
            t = C[i, j]
            for q in range(j):
                t -= L[i, q] * L[j, q]
            if i == j:
                if not 0.0 < t < math.inf:
                    return False
                L[i, i] = math.sqrt(t)
            else:
                L[i, j] = t / L[j, j]
    return True


def spanned(W: _Array, rounding: float, sure: float, Q: _Array) -> tuple[int, bool]:
    """An orthonormal basis of what the rows of W span, in the first rows of Q; their number, and whether it is clear.

    W is overwritten.
    """
    m, size = W.shape
    first, last, rank, pivot, longest = 0.0, 0.0, 0, 0, 0.0
    for r in range(m):
        t = 0.0
        for q in range(size):
            t += W[r, q] * W[r, q]
        if t > longest:
            pivot, longest = r, t
    while rank < size:
        if rank == 0:
            first = longest
        if not longest > rounding * first:
            break
        last, u = longest, Q[rank]
        for q in range(size):
            u[q] = W[pivot, q]
        for x in range(rank):
            t = 0.0
            for q in range(size):
                t += Q[x, q] * u[q]
            for q in range(size):
                u[q] -= t * Q[x, q]
        t = 0.0
        for q in range(size):
            t += u[q] * u[q]
        t = 1.0 / math.sqrt(t)
        for q in range(size):
            u[q] *= t
        r, pivot, longest = 0, 0, 0.0
        while r < m:
            t, left = 0.0, 0.0
            for q in range(size):
                t += W[r, q] * u[q]
            for q in range(size):
                W[r, q] -= t * u[q]
                left += W[r, q] * W[r, q]
            if left > rounding * first:
                if left > longest:
                    pivot, longest = r, left
                r += 1
            else:  # nothing but rounding is left of it: the last row takes its place
                m -= 1
                for q in range(size):
                    W[r, q] = W[m, q]
        rank += 1
    return rank, rank == 0 or last > sure * first
