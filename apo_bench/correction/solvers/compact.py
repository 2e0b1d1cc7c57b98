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
from functools import cached_property
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Equations
from apo_bench.correction.solvers.word_products import Words, words_of
from apo_bench.geometry import GENERATORS, Array

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
        e = self.points @ self._reached(self.words.prefixes(self.constants, T))[..., 6:]
        return np.asarray(e.reshape(*T.shape[:-3], 3 * len(self)))

    def linearise(self, T: Array, B: Array | None) -> Linearised:
        """Linearise every equation at the poses T, (*, n, 4, 4): df/dq of Eq. 10.

        By the derivatives of the paper's appendix, which hold at dq = 0. A contact sees its word move by one twist,
        which is the sum of what its letters make of theirs (`Words.adjoints`).

        Args:
            B: (*, n, 6, 6), the body twist of each pose per unit of its coordinates; None stands for the twists.
        """
        prefixes = self.words.prefixes(self.constants, T)
        reached = self._reached(prefixes)
        equations = self.points @ reached
        turned = self.words.adjoints(prefixes)
        if B is not None:
            turned = turned @ B.take(self.words.operation, axis=-3)
        e = equations[..., 6].reshape(*T.shape[:-3], 3 * len(self))
        return Linearised(reached[..., 6], e, equations[..., :6], turned)

    def _reached(self, prefixes: Array) -> Array:
        """n G D_a^-1 D_b of each contact for the six unit twists G, and without one, (*, c, 4, 7)."""
        words = np.swapaxes(prefixes[..., -1, :, :, :], -1, -2)
        return np.asarray(words.take(self.words.of, axis=-3) @ self._reach)

    @cached_property
    def _reach(self) -> Array:
        """n G, (c, 4, 7)."""
        return np.swapaxes((self.plane @ _TWISTS_AND_ONE).reshape(len(self), 7, 4), 1, 2)


class Linearised(NamedTuple):
    """Equations at some poses, and their derivative in two factors: of contacts, and of letters."""

    forms: Array
    """(*, c, 4), as of `CompactEquations.forms`."""
    e: Array
    """(*, 3 c), [m]."""
    rows: Array
    """(*, c, 3, 6), the derivative of e by the twist of its word, in the frame of the manipulated part."""
    turned: Array
    """(*, u, 6, 6), the twist of a word per unit of the coordinates of each of its unknown letters."""


_TWISTS_AND_ONE = np.ascontiguousarray(np.swapaxes(np.concatenate([GENERATORS, np.eye(4)[None]]), 0, 1)).reshape(4, 28)
"""d(dT)/dq_i of the appendix and the identity, side by side."""


def build_compact_equations(system: Equations, n: int) -> CompactEquations:
    """Equations in compact form: three per contact, in the motion parameters of `n` operations."""
    words = words_of(system.letters, system.inverse, len(system.start), n)
    plane = np.zeros((len(words), 4))
    plane[system.contact] = system.plane
    points = moments(system.vertex[:, :3], system.contact, len(words))
    return CompactEquations(words, words.constants(system.start), plane, points)


def linearise_by(system: CompactEquations, T: Array, B: Array) -> tuple[Array, Array]:
    """e, (*, 3 c), [m], at the poses T, (*, n, 4, 4), and its derivative by z, transposed, (*, 6 n, 3 c).

    Args:
        B: (*, n, 6, 6) or (*, n, 6, 6 n): what a change of z makes of the body twist of each pose.
    """
    known, J = linearise_densely(system, T, B)
    return known.e, np.swapaxes(J, -1, -2)


def linearise_densely(system: CompactEquations, T: Array, B: Array) -> tuple[Linearised, Array]:
    """The same with all that is known there, and the derivative as it is, (*, 3 c, 6 n)."""
    shared = B.shape[-1] != 6
    known = system.linearise(T, None if shared else B)
    words = system.words
    lead = T.shape[:-3]
    g = len(words.letters)
    # What z makes of the twist of each word, (*, g, 6, 6 n).
    moved = np.zeros((*lead, g * 36 * words.n))
    if words.once:
        moved[..., words.entries] = known.turned
    else:
        for i, entries in enumerate(words.entries):
            moved[..., entries] += known.turned[..., i, :, :]
    moved = moved.reshape(*lead, g, 6, 6 * words.n).take(words.of, axis=-3)
    J = (known.rows @ moved).reshape(*lead, 3 * len(system), 6 * words.n)
    if shared:  # every pose depends on every number of z
        J = J @ B.reshape(*lead, 6 * words.n, 6 * words.n)
    return known, J


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
