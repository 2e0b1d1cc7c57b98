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
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.equations import Equations, Pattern, pattern
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, remembered
from apo_bench.geometry.twist import GENERATORS

_GENERATORS = np.ascontiguousarray(np.swapaxes(GENERATORS, 0, 1).reshape(4, 24))
_ONE = np.eye(4)
ROUNDING = 1e-15
SMALLEST = 1e-300
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

    def only(self, some: Any) -> CompactEquations:
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
        for known in ("_once", "_sides", "_signed_columns", "_rows", "_words"):
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
        M = np.broadcast_to(_ONE, (*F.shape[:-3], 4, 4))
        for j in range(self.letters.shape[1]):
            M = M @ F[..., j, :, :] if j else F[..., j, :, :]
        return np.asarray(M)

    def gathered(self, blocks: Array) -> Array:
        """The transposed Jacobian (*, 6 n, 3 c) out of its blocks (*, c, w, 6, 3)."""
        lead = blocks.shape[:-4]
        c = len(self)
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
    def _words(self) -> NDArray[np.intp]:
        """(3, c, w): letters, columns, inverse."""
        return np.array([self.letters, self.columns, self.inverse], dtype=np.intp)

    def for_kernels(self) -> tuple[NDArray[np.intp], Array]:
        """The words, (3, c, w), and all matrices with their inverses, (2, p + n + 1, 4, 4), as kernels take them."""
        return self._words, np.array(self._constants.reshape(2, -1, 4, 4))

    @cached_property
    def _constants(self) -> Array:
        """(2 (p + n + 1), 4, 4): all matrices and then their inverses, of the goals only the last row."""
        p = len(self.start)
        n = self.n
        stack = np.zeros((2, p + n + 1, 4, 4))
        stack[:, p:, 3, 3] = 1.0
        stack[:, p + n] = _ONE
        stack[0, :p] = self.start
        stack[1, :p] = pose.inverse(self.start)
        return stack.reshape(-1, 4, 4)

    def _behind(self, F: Array) -> Array:
        """(everything from letter j on) v, (*, w + 1, c, 3, 4)."""
        c, w = self.letters.shape
        points = np.empty((*F.shape[:-4], w + 1, c, 3, 4))
        transposed = np.swapaxes(F, -1, -2)
        points[..., w, :, :, :] = self.points
        for j in reversed(range(w)):
            np.matmul(points[..., j + 1, :, :, :], transposed[..., j, :, :], out=points[..., j, :, :, :])
        return points

    def _factors(self, T: Array) -> Array:
        """Every letter of every word, (*, c, w, 4, 4)."""
        p = len(self.start)
        n = self.n
        stack = np.empty((*T.shape[:-3], 2 * (p + n + 1), 4, 4))
        stack[:] = self._constants
        back = stack[..., 2 * p + n + 1 : 2 * (p + n) + 1, :, :]
        stack[..., p : p + n, :, :] = T
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


def linearised_by(system: CompactEquations, T: Array, B: Array) -> tuple[Array, Array]:
    """e, (*, 3 c), [m], at the goals T, (*, n, 4, 4), and its derivative by z, transposed, (*, 6 n, 3 c).

    Args:
        B: (*, n, 6, 6) or (*, n, 6, 6 n): what a change of z makes of the body twist of each goal.
    """
    if B.shape[-1] == 6:
        e, blocks = system.blocks(T, B)
        return e, system.gathered(blocks)
    # Every goal depends on every number of z: J by all body twists, times what z makes of them.
    size = B.shape[-1]
    e, blocks = system.blocks(T, np.broadcast_to(np.eye(6), (*T.shape[:-2], 6, 6)))
    return e, np.asarray(np.swapaxes(B.reshape(*T.shape[:-3], size, size), -1, -2) @ system.gathered(blocks))


@final
@dataclass(frozen=True, eq=False)
class Laid:
    """The vertices of all contacts, laid onto the faces that they lie on at some goals."""

    system: CompactEquations
    """With points (*, c, 3, 4)."""
    vertex: Array
    """(*, m, 4), frame of the environment part, [m]."""
    forms: Array
    """As of `forms_at`, at these goals."""
    known: Pattern

    def forms_at(self, T: Array) -> Array:
        """n D_a^-1 D_b of each contact, (*, c, 4), at the goals T, (*, n, 4, 4): e of any vertex is this times it."""
        return np.asarray((self.system.plane[:, None] @ self.system.words(T))[..., 0, :])

    def gaps(self, forms: Array) -> Array:
        """The largest |e| of each contact, (*, c), [m]."""
        if not len(self.known.contact):
            return np.zeros(forms.shape[:-1])
        e = (forms.take(self.known.contact, axis=-2) * self.vertex).sum(axis=-1)
        return np.asarray(np.maximum.reduceat(np.abs(e), self.known.begin[:-1], axis=-1))

    def looking_away(self, forms: Array) -> NDArray[np.bool_]:
        """Which contacts have faces that do not look at each other, (*, c), as `assembly.opposing` has it."""
        cosines = (forms[..., :3] * self.known.onto[:, :3]).sum(axis=-1)
        return np.asarray(cosines > self.known.opposing)


def laid_contacts(assembly: Assembly, start: Array, plane: Array, goals: Array) -> Laid:
    """The compact equations of all contacts of an assembly, vertices where they are at the goals, (*, n, 4, 4).

    Vertices of the environment's face are where they are; those of the manipulated face are laid onto the other one:
    taken back by the word of their contact at the goals, and dropped onto its plane. That is one affine map for each
    contact, which takes the three points that stand for the vertices along.

    Args:
        start: (p, 4, 4).
        plane: (c, 4), shifted to where contacts are asked to be.
    """
    known = pattern(assembly)
    base = _words_alone(assembly)
    system = base.placed(start, plane, base.points)
    words = system.words(goals)
    maps = np.where(known.laid[:, None, None], _drops(assembly) @ pose.inverse(words), _ONE)
    vertex = (maps.take(known.contact, axis=-3) @ known.corners[..., None])[..., 0]
    forms = (plane[:, None] @ words)[..., 0, :]
    points = base.points @ np.swapaxes(maps, -1, -2)
    return Laid(system.placed(start, plane, points), vertex, forms, known)


@remembered
def _drops(assembly: Assembly) -> Array:
    """The maps v -> v - n (n v) that drop points onto the face of the environment of each contact, (c, 4, 4)."""
    onto = pattern(assembly).onto
    normal = np.array(onto)
    normal[:, 3:] = 0.0
    return np.asarray(_ONE - normal[:, :, None] * onto[:, None, :])


@remembered
def _words_alone(assembly: Assembly) -> CompactEquations:
    """The words of an assembly, all parts at the origin, and its corners as they are."""
    known = pattern(assembly)
    p = len(assembly.solids)
    n = len(assembly)
    k = known.letters - p
    columns = np.where((k >= 0) & (k < n), k, n)
    start = np.tile(_ONE, (p, 1, 1))
    points = moments(known.corners[:, :3], known.contact, len(known.letters))
    return CompactEquations(start, known.letters, columns, known.inverse, known.plane, points, n)


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
    least = ROUNDING * S.reshape(c, 9)[:, ::4].sum(axis=1) + SMALLEST
    for k in (1, 2):
        pivot = S.reshape(c, 9)[:, ::4].argmax(axis=1)
        a = S[at, pivot]
        a /= np.sqrt(np.maximum(a[at, pivot], least))[:, None]
        points[:, k, :3] = a
        S -= a[:, :, None] * a[:, None, :]
    return points
