"""The contact equations in their smallest form: three per contact, whatever the number of vertices.

The vertices of a face lie in a plane, so e, which is linear in them, is known everywhere once it is known at their
centre, and how fast it grows along two directions. Scaled by the square root of the number of vertices, and with
directions that have the same second moments as the centred vertices, these three have the same sum of squares as e of
all vertices. Nothing is lost, and the matrices are smaller by a quarter. The largest of the three is not the largest e
of a vertex: e at the centre of v vertices counts sqrt(v) times.

Every array may have leading axes: many observations of one assembly are linearised at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Equations
from apo_bench.correction.solvers.word_products import Words
from apo_bench.geometry import GENERATORS, Array

_GENERATORS = np.ascontiguousarray(np.swapaxes(GENERATORS, 0, 1).reshape(4, 24))
_LEAST_PIVOT = 1e-15
_LEAST_SQUARE = 1e-300
"""Pivots of vertices on a line, as part of the mean square of their ways, and of vertices that coincide."""


@final
@dataclass(frozen=True, eq=False)
class CompactEquations:
    """c contacts with three equations each, in the motion parameters of n operations."""

    words: Words
    """D_a^-1 D_b of each contact."""
    constants: Array
    """(2, p + n + 1, 4, 4): the constant motion parameters, as `Words.constants` has them."""
    plane: Array
    """(c, 4): n of Eq. 1, frame of the manipulated part."""
    points: Array
    """(*, c, 3, 4): what stands for the vertices, homogeneous; the last two are directions."""

    def __len__(self) -> int:
        return len(self.plane)

    @property
    def n(self) -> int:
        """The number of operations."""
        return self.words.n

    def only(self, some: Any) -> CompactEquations:
        """The equations of some of the observations, if each has points of its own."""
        return self if self.points.ndim == 3 else replace(self, points=self.points[some])

    def among(self, contacts: NDArray[np.bool_]) -> CompactEquations:
        """The equations of these contacts, (c,), alone."""
        points = self.points[..., contacts, :, :]
        return CompactEquations(self.words.among(contacts), self.constants, self.plane[contacts], points)

    def forms(self, T: Array) -> Array:
        """n D_a^-1 D_b of each contact, (*, c, 4), at the poses T, (*, n, 4, 4): e of any vertex is this times it."""
        return np.asarray((self.plane[:, None] @ self.words.products(self.constants, T))[..., 0, :])

    def residual(self, T: Array) -> Array:
        """e of every equation, (*, 3 c), at the poses T, (*, n, 4, 4), [m]."""
        e = self._behind(self.words.factors(self.constants, T))[..., 0, :, :, :] @ self.plane[:, :, None]
        return np.asarray(e.reshape(*e.shape[:-3], 3 * len(self)))

    def blocks(self, T: Array, B: Array) -> tuple[Array, Array]:
        """e, (*, 3 c), [m], and its derivative by the coordinates of each letter's pose, (*, c, w, 6, 3).

        It is df/dq of Eq. 10, by the derivatives of the paper's appendix, which hold at dq = 0.

        A letter T in n .. T .. v turns n (everything up to T) = f and (everything behind T) v = p, and a unit twist G
        changes e by f G p; T^-1 stays on the side of p, with the opposite sign. A T that occurs twice adds up.

        Args:
            B: (*, n, 6, 6), the body twist of each pose per unit of its coordinates.
        """
        F = self.words.factors(self.constants, T)
        lead = F.shape[:-4]
        c, w = self.words.letters.shape
        # behind[j] = F_j+1 .. F_w v and forms[j] = n F_1 .. F_j, from both ends of each word.
        behind = self._behind(F)
        forms = np.empty((*lead, w + 1, c, 1, 4))
        forms[..., 0, :, 0, :] = self.plane
        for j in range(w):
            np.matmul(forms[..., j, :, :, :], F[..., j, :, :], out=forms[..., j + 1, :, :, :])
        e = behind[..., 0, :, :, :] @ self.plane[:, :, None]
        # f G_i of the generators G_i = d(dT)/dq_i (appendix), and p, on the side of each letter where its change acts.
        fG = forms.reshape(*lead, (w + 1) * c, 4).take(self.words.sides, axis=-2) @ _GENERATORS
        p = behind.reshape(*lead, (w + 1) * c, 3, 4).take(self.words.sides, axis=-3)
        # B^t of each letter's pose, with its sign: what twists make of coordinates z.
        signed = np.zeros((*B.shape[:-3], 2, self.n + 1, 6, 6))
        signed[..., 0, : self.n, :, :] = np.swapaxes(B, -1, -2)
        np.negative(signed[..., 0, :, :, :], out=signed[..., 1, :, :, :])
        scaled = signed.reshape(*B.shape[:-3], 2 * (self.n + 1), 6, 6).take(self.words.signed_columns, axis=-3)
        return e.reshape(*lead, 3 * c), scaled @ (fG.reshape(*p.shape[:-2], 6, 4) @ np.swapaxes(p, -1, -2))

    def gathered(self, blocks: Array) -> Array:
        """The transposed Jacobian (*, 6 n, 3 c) out of its blocks (*, c, w, 6, 3)."""
        lead = blocks.shape[:-4]
        c = len(self)
        columns = self.words.columns
        J = np.zeros((*lead, self.n + 1, c, 6, 3))
        if self.words.once:
            J[..., columns, np.arange(c)[:, None], :, :] = blocks
        else:
            for j in range(columns.shape[1]):
                J[..., columns[:, j], np.arange(c), :, :] += blocks[..., j, :, :]
        return np.swapaxes(J[..., : self.n, :, :, :], -3, -2).reshape(*lead, 6 * self.n, 3 * c)

    def _behind(self, F: Array) -> Array:
        """(everything from letter j on) v, (*, w + 1, c, 3, 4)."""
        c, w = self.words.letters.shape
        points = np.empty((*F.shape[:-4], w + 1, c, 3, 4))
        transposed = np.swapaxes(F, -1, -2)
        points[..., w, :, :, :] = self.points
        for j in reversed(range(w)):
            np.matmul(points[..., j + 1, :, :, :], transposed[..., j, :, :], out=points[..., j, :, :, :])
        return points


def build_compact_equations(system: Equations, n: int) -> CompactEquations:
    """Equations in compact form: three per contact, in the motion parameters of `n` operations."""
    words = Words(system.letters, system.inverse, len(system.start), n)
    plane = np.zeros((len(words), 4))
    plane[system.contact] = system.plane
    points = moments(system.vertex[:, :3], system.contact, len(words))
    return CompactEquations(words, words.constants(system.start), plane, points)


def linearise_by(system: CompactEquations, T: Array, B: Array) -> tuple[Array, Array]:
    """e, (*, 3 c), [m], at the poses T, (*, n, 4, 4), and its derivative by z, transposed, (*, 6 n, 3 c).

    Args:
        B: (*, n, 6, 6) or (*, n, 6, 6 n): what a change of z makes of the body twist of each pose.
    """
    if B.shape[-1] == 6:
        e, blocks = system.blocks(T, B)
        return e, system.gathered(blocks)
    # Every pose depends on every number of z: J by all body twists, times what z makes of them.
    size = B.shape[-1]
    e, blocks = system.blocks(T, np.broadcast_to(np.eye(6), (*T.shape[:-2], 6, 6)))
    return e, np.asarray(np.swapaxes(B.reshape(*T.shape[:-3], size, size), -1, -2) @ system.gathered(blocks))


def moments(vertex: Array, contact: NDArray[np.intp], c: int) -> Array:
    """The centre of the vertices (m, 3) of each contact and two directions, (c, 3, 4), with the same moments.

    Vertices of one contact stand next to each other, and each contact has some. They lie in a plane, so the sum S of
    off off^t, over their ways off the centre, is a a^t + b b^t: two steps of a Cholesky factorisation that takes the
    largest pivot first.
    """
    points = np.zeros((c, 3, 4))
    if not c:
        return points
    count = np.bincount(contact, minlength=c)
    begin = np.cumsum(count) - count
    center = np.add.reduceat(vertex, begin) / count[:, None]
    off = vertex - center[contact]
    S = np.add.reduceat(off[:, :, None] * off[:, None, :], begin)
    points[:, 0, :3] = center
    points[:, 0, 3] = 1.0
    points[:, 0] *= np.sqrt(count)[:, None]
    at = np.arange(c)
    least = _LEAST_PIVOT * S.reshape(c, 9)[:, ::4].sum(axis=1) + _LEAST_SQUARE
    for k in (1, 2):
        pivot = S.reshape(c, 9)[:, ::4].argmax(axis=1)
        a = S[at, pivot]
        a /= np.sqrt(np.maximum(a[at, pivot], least))[:, None]
        points[:, k, :3] = a
        S -= a[:, :, None] * a[:, None, :]
    return points
