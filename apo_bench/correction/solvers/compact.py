"""Contact equations in compact form: three per contact, whatever the number of vertices.

The vertices of a face lie in a plane and e is linear in them. So e is determined by its value at their centre and its
growth along two directions. The centre is scaled by the square root of the number of vertices, and the directions have
the same second moments as the centred vertices. Then the three equations have the same sum of squares as e of all
vertices. Nothing is lost, and the matrices are smaller by a quarter. The largest of the three is not the largest e of a
vertex: e at the centre of v vertices counts sqrt(v) times.

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
"""Least pivot relative to the mean square of the offsets of the vertices, for vertices on a line."""
_LEAST_SQUARE = 1e-300
"""Least pivot, [m^2], for vertices that coincide."""


@final
@dataclass(frozen=True, eq=False)
class CompactEquations:
    """The equations of c contacts, three each, in the motion parameters of n operations."""

    words: Words
    """D_a^-1 D_b of each contact."""
    constants: Array
    """(2, p + n + 1, 4, 4): the constant motion parameters, as `Words.constants` has them."""
    plane: Array
    """(c, 4): n of Eq. 1, frame of the manipulated part."""
    points: Array
    """(*, c, 3, 4): three homogeneous points that stand for the vertices, a scaled centre and two directions."""

    def __len__(self) -> int:
        return len(self.plane)

    @property
    def n(self) -> int:
        """The number of operations."""
        return self.words.n

    def only(self, some: Any) -> CompactEquations:
        """The equations of some of the observations, if each has its own points; else unchanged."""
        return self if self.points.ndim == 3 else replace(self, points=self.points[some])

    def among(self, contacts: NDArray[np.bool_]) -> CompactEquations:
        """The equations of the chosen contacts, (c,), alone."""
        points = self.points[..., contacts, :, :]
        return CompactEquations(self.words.among(contacts), self.constants, self.plane[contacts], points)

    def forms(self, T: Array) -> Array:
        """n D_a^-1 D_b of each contact, (*, c, 4), at the poses T, (*, n, 4, 4); its product with any vertex is e."""
        return np.asarray((self.plane[:, None] @ self.words.products(self.constants, T))[..., 0, :])

    def residual(self, T: Array) -> Array:
        """The residual e of every equation, (*, 3 c), at the poses T, (*, n, 4, 4), [m]."""
        e = self.points @ self._reached(self.words.prefixes(self.constants, T))[..., 6:]
        return np.asarray(e.reshape(*T.shape[:-3], 3 * len(self)))

    def linearise(self, T: Array, B: Array | None) -> Linearised:
        """Linearise every equation at the poses T, (*, n, 4, 4): df/dq of Eq. 10.

        It uses the derivatives of the paper's appendix, which hold at dq = 0. A contact depends on the twist of its
        word, which is the sum of the contributions of its letters (`Words.adjoints`).

        Args:
            B: (*, n, 6, 6), the body twist of each pose per unit of its coordinates; None: coordinates are the twists.
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
        """n G D_a^-1 D_b of each contact for the six unit twists G, and at last without one, (*, c, 4, 7)."""
        words = np.swapaxes(prefixes[..., -1, :, :, :], -1, -2)
        return np.asarray(words.take(self.words.of, axis=-3) @ self._reach)

    @cached_property
    def _reach(self) -> Array:
        """n G for the six unit twists, and n, (c, 4, 7)."""
        return np.swapaxes((self.plane @ _TWISTS_AND_ONE).reshape(len(self), 7, 4), 1, 2)


class Linearised(NamedTuple):
    """Equations at some poses, with their derivative as a product of a factor per contact and a factor per letter."""

    forms: Array
    """(*, c, 4), as of `CompactEquations.forms`."""
    e: Array
    """(*, 3 c), residuals, [m]."""
    rows: Array
    """(*, c, 3, 6), the derivative of e by the twist of its word, in the frame of the manipulated part."""
    turned: Array
    """(*, u, 6, 6), the twist of a word per unit of the coordinates of each of its unknown letters."""


_TWISTS_AND_ONE = np.ascontiguousarray(np.swapaxes(np.concatenate([GENERATORS, np.eye(4)[None]]), 0, 1)).reshape(4, 28)
"""d(dT)/dq_i of the appendix and the identity, side by side."""


def build_compact_equations(system: Equations, n: int) -> CompactEquations:
    """Convert equations to compact form: three per contact, in the motion parameters of `n` operations."""
    words = words_of(system.letters, system.inverse, len(system.start), n)
    plane = np.zeros((len(words), 4))
    plane[system.contact] = system.plane
    points = moments(system.vertex[:, :3], system.contact, len(words))
    return CompactEquations(words, words.constants(system.start), plane, points)


def linearise_by(system: CompactEquations, T: Array, B: Array) -> tuple[Array, Array]:
    """The residual e, (*, 3 c), [m], at the poses T, (*, n, 4, 4), and its transposed derivative by z, (*, 6 n, 3 c).

    Args:
        B: (*, n, 6, 6) or (*, n, 6, 6 n): derivative of the body twist of each pose by z.
    """
    known, J = linearise_densely(system, T, B)
    return known.e, np.swapaxes(J, -1, -2)


def linearise_densely(system: CompactEquations, T: Array, B: Array) -> tuple[Linearised, Array]:
    """The linearised equations, and the derivative by z, (*, 3 c, 6 n); arguments as in `linearise_by`."""
    shared = B.shape[-1] != 6
    known = system.linearise(T, None if shared else B)
    words = system.words
    lead = T.shape[:-3]
    g = len(words.letters)
    # Derivative of the twist of each word by z, (*, g, 6, 6 n).
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
    """The scaled centre of the vertices of each contact and two directions with the same second moments, (c, 3, 4).

    The sum S of off off^t over the offsets from the centre has rank 2, since the vertices lie in a plane. So S = a a^t
    + b b^t, by two steps of a Cholesky factorisation with the largest pivot first.

    Args:
        vertex: (m, 3), [m]; those of one contact are consecutive.
        contact: (m,), the contact of each vertex.
        c: Number of contacts, each with at least one vertex.
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
