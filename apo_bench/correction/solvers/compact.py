"""The contact equations in their smallest form: three per contact, whatever the number of vertices.

The vertices of a face lie in a plane, so e, which is linear in them, is known everywhere once it is known at their
centre, and how fast it grows along two directions. Scaled by the square root of the number of vertices, and with
directions that have the same second moments as the centred vertices, these three have the same sum of squares as e of
all vertices. Nothing is lost, and the matrices are smaller by a quarter.

Every array may have leading axes: many observations of one assembly are linearised at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.equations import Equations, Pattern, pattern
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.remembered import remembered
from apo_bench.geometry.twist import GENERATORS

_GENERATORS = np.ascontiguousarray(np.swapaxes(GENERATORS, 0, 1).reshape(4, 24))
_ONE = np.eye(4)
ROUNDING, SMALLEST = 1e-15, 1e-300
"""Pivots of vertices on a line, as part of the mean square of their ways, and of vertices that coincide."""


@final
@dataclass(frozen=True, eq=False)
class CompactEquations:
    """c contacts with three equations each, in the motion parameters of n operations."""

    start: Array
    """(p, 4, 4): the constant motion parameters."""
    letters: NDArray[np.intp]
    """(c, w): as in `Equations`."""
    columns: NDArray[np.intp]
    """(c, w): the operation of each letter; n for letters that are constants or padding."""
    inverse: NDArray[np.bool_]
    """(c, w)."""
    plane: Array
    """(c, 4): n of Eq. 1, frame of the manipulated part."""
    points: Array
    """(*, c, 3, 4): what stands for the vertices, homogeneous; the last two are directions."""
    n: int

    def __len__(self) -> int:
        return len(self.letters)

    def only(self, some: NDArray[np.bool_]) -> CompactEquations:
        """The equations of some of the observations, if each has points of its own."""
        return self if self.points.ndim == 3 else replace(self, points=self.points[some])

    def among(self, contacts: NDArray[np.bool_]) -> CompactEquations:
        """The equations of these contacts, (c,), alone."""
        return replace(
            self,
            letters=self.letters[contacts],
            columns=self.columns[contacts],
            inverse=self.inverse[contacts],
            plane=self.plane[contacts],
            points=self.points[..., contacts, :, :],
        )

    def placed(self, start: Array, plane: Array, points: Array) -> CompactEquations:
        """The same words with other constants, planes and points; what is known of the words goes along."""
        one = replace(self, start=start, plane=plane, points=points)
        for known in ("_once", "_sides", "_signed_columns", "_rows"):
            one.__dict__[known] = getattr(self, known)
        return one

    def residual(self, T: Array) -> Array:
        """e of every equation, (*, 3 c), at the goals T, (*, n, 4, 4), [m]."""
        e = self._behind(self._factors(T))[..., 0, :, :, :] @ self.plane[:, :, None]
        return np.asarray(e.reshape(*e.shape[:-3], 3 * len(self)))

    def blocks(self, T: Array, B: Array) -> tuple[Array, Array]:
        """e, (*, 3 c), [m], and its derivative by the coordinates of each letter's goal, (*, c, w, 6, 3) (Eq. 14).

        A letter T in n .. T .. v turns n (everything up to T) = f and (everything behind T) v = p, and a unit twist G
        changes e by f G p; T^-1 stays on the side of p, with the opposite sign. A T that occurs twice adds up.

        Args:
            B: (*, n, 6, 6), the body twist of each goal per unit of its coordinates.
        """
        F = self._factors(T)
        c, w = self.letters.shape
        behind = self._behind(F)
        forms = np.empty((*F.shape[:-4], w + 1, c, 1, 4))
        forms[..., 0, :, 0, :] = self.plane
        for j in range(w):
            np.matmul(forms[..., j, :, :, :], F[..., j, :, :], out=forms[..., j + 1, :, :, :])
        e = behind[..., 0, :, :, :] @ self.plane[:, :, None]
        lead = F.shape[:-4]
        fG = forms.reshape(*lead, (w + 1) * c, 4).take(self._sides, axis=-2) @ _GENERATORS
        p = behind.reshape(*lead, (w + 1) * c, 3, 4).take(self._sides, axis=-3)
        signed = np.zeros((*B.shape[:-3], 2, self.n + 1, 6, 6))
        signed[..., 0, : self.n, :, :] = np.swapaxes(B, -1, -2)
        np.negative(signed[..., 0, :, :, :], out=signed[..., 1, :, :, :])
        scaled = signed.reshape(*B.shape[:-3], 2 * (self.n + 1), 6, 6).take(self._signed_columns, axis=-3)
        return e.reshape(*e.shape[:-3], 3 * c), scaled @ (fG.reshape(*p.shape[:-2], 6, 4) @ np.swapaxes(p, -1, -2))

    def words(self, T: Array) -> Array:
        """D_a^-1 D_b of every contact, (*, c, 4, 4)."""
        F = self._factors(T)
        M = F[..., 0, :, :]
        for j in range(1, self.letters.shape[1]):
            M = M @ F[..., j, :, :]
        return np.asarray(M)

    def gathered(self, blocks: Array) -> Array:
        """The transposed Jacobian (*, 6 n, 3 c) out of its blocks (*, c, w, 6, 3)."""
        lead, c = blocks.shape[:-4], len(self)
        J = np.zeros((*lead, self.n + 1, c, 6, 3))
        if self._once:
            J[..., self.columns, np.arange(c)[:, None], :, :] = blocks
        else:
            for j in range(self.letters.shape[1]):
                J[..., self.columns[:, j], np.arange(c), :, :] += blocks[..., j, :, :]
        return np.swapaxes(J[..., : self.n, :, :, :], -3, -2).reshape(*lead, 6 * self.n, 3 * c)

    @cached_property
    def _once(self) -> bool:
        """Whether no motion parameter occurs twice in a word."""
        ordered = np.sort(self.columns, axis=1)
        return not bool(((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] < self.n)).any())

    @cached_property
    def _sides(self) -> NDArray[np.intp]:
        """(c, w): where the points and planes of each letter stand among those of all, (w + 1, c)."""
        c, w = self.letters.shape
        return (np.arange(w) + ~self.inverse) * c + np.arange(c)[:, None]

    @cached_property
    def _signed_columns(self) -> NDArray[np.intp]:
        """(c, w): the column of each letter, behind all columns where the sign changes."""
        return self.columns + self.inverse * (self.n + 1)

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """(c, w): where each letter stands among all matrices and then their inverses."""
        return self.letters + self.inverse * (len(self.start) + self.n + 1)

    @cached_property
    def _constants(self) -> Array:
        """(2 (p + n + 1), 4, 4): all matrices and then their inverses, of the goals only the last row."""
        p, n = len(self.start), self.n
        stack = np.zeros((2, p + n + 1, 4, 4))
        stack[:, p:, 3, 3], stack[:, p + n] = 1.0, _ONE
        stack[0, :p], stack[1, :p] = self.start, pose.inverse(self.start)
        return stack.reshape(-1, 4, 4)

    def _behind(self, F: Array) -> Array:
        """(everything from letter j on) v, (*, w + 1, c, 3, 4)."""
        c, w = self.letters.shape
        points, transposed = np.empty((*F.shape[:-4], w + 1, c, 3, 4)), np.swapaxes(F, -1, -2)
        points[..., w, :, :, :] = self.points
        for j in reversed(range(w)):
            np.matmul(points[..., j + 1, :, :, :], transposed[..., j, :, :], out=points[..., j, :, :, :])
        return points

    def _factors(self, T: Array) -> Array:
        """Every letter of every word, (*, c, w, 4, 4)."""
        p, n = len(self.start), self.n
        stack = np.empty((*T.shape[:-3], 2 * (p + n + 1), 4, 4))
        stack[:] = self._constants
        stack[..., p : p + n, :, :], back = T, stack[..., 2 * p + n + 1 : 2 * (p + n) + 1, :, :]
        back[..., :3, :3] = np.swapaxes(T[..., :3, :3], -1, -2)
        back[..., :3, 3:] = -back[..., :3, :3] @ T[..., :3, 3:]
        return stack.take(self._rows, axis=-3)


def compact_equations(system: Equations, n: int) -> CompactEquations:
    """Equations in compact form: three per contact, in the motion parameters of `n` operations."""
    letters = system.letters
    k = letters - len(system.start)
    columns = np.where((k >= 0) & (k < n), k, n)
    plane = np.zeros((len(letters), 4))
    plane[system.contact] = system.plane
    points = moments(system.vertex[:, :3], system.contact, len(letters))
    return CompactEquations(system.start, letters, columns, system.inverse, plane, points, n)


def compact_assembly(assembly: Assembly, system: Equations) -> CompactEquations:
    """`compact_equations` of all equations of an assembly; what does not depend on goals is worked out once."""
    known, base = pattern(assembly), _words_alone(assembly)
    points, rows = np.array(base.points), known.laid[known.contact]
    if rows.any():
        number = (np.cumsum(known.laid) - 1)[known.contact[rows]]
        points[known.laid] = moments(system.vertex[rows, :3], number, int(np.count_nonzero(known.laid)))
    return base.placed(system.start, system.plane[known.begin[:-1]], points)


@remembered
def _words_alone(assembly: Assembly) -> CompactEquations:
    """The words of an assembly, all parts at the origin, and its corners as they are."""
    known, p, n = pattern(assembly), len(assembly.solids), len(assembly)
    k = known.letters - p
    columns, start = np.where((k >= 0) & (k < n), k, n), np.tile(_ONE, (p, 1, 1))
    return CompactEquations(start, known.letters, columns, known.inverse, known.plane, corner_moments(known), n)


def corner_moments(known: Pattern) -> Array:
    """Three points that stand for the corners of each contact, (c, 3, 4), in the frame that these are in."""
    return moments(known.corners[:, :3], known.contact, len(known.letters))


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
    points[:, 0, :3], points[:, 0, 3] = center, 1.0
    points[:, 0] *= np.sqrt(count)[:, None]
    at, least = np.arange(c), ROUNDING * S.reshape(c, 9)[:, ::4].sum(axis=1) + SMALLEST
    for k in (1, 2):
        pivot = S.reshape(c, 9)[:, ::4].argmax(axis=1)
        a = S[at, pivot]
        a /= np.sqrt(np.maximum(a[at, pivot], least))[:, None]
        points[:, k, :3] = a
        S -= a[:, :, None] * a[:, None, :]
    return points
