"""The relative pose in each contact equation, D_a^-1 D_b, and how it moves with the poses of the operations.

Such a product is a word, and the poses in it, start poses and operations' poses or their inverses, are its letters.
Contacts between the same parts have the same word, which is multiplied out once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import ADJOINTS, Array, remember

_ONE = np.eye(4)
_HAT = np.ascontiguousarray(ADJOINTS[3:, :3, :3]).reshape(3, 9)
"""The matrix of the cross product with t is sum_i t_i _HAT[i], rows of three."""


@final
@dataclass(frozen=True, eq=False)
class Words:
    """g words of at most w letters, in the motion parameters of n operations and p constants, of c contacts."""

    letters: NDArray[np.intp]
    """(g, w): as in `Equations`: p constants, then n poses, then the identity as padding."""
    inverse: NDArray[np.bool_]
    """(g, w): which letters are inverted."""
    of: NDArray[np.intp]
    """(c,): the word of each contact."""
    p: int
    n: int

    def __len__(self) -> int:
        return len(self.of)

    def among(self, contacts: NDArray[np.bool_]) -> Words:
        """The words of these contacts, (c,), alone."""
        return _among(self, contacts.tobytes())

    @cached_property
    def unknown(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The words and places, (u,), of the letters that are poses of operations."""
        word, place = np.nonzero((self.letters >= self.p) & (self.letters < self.p + self.n))
        return word, place

    @cached_property
    def operation(self) -> NDArray[np.intp]:
        """(u,): the operation of each unknown letter."""
        return np.asarray(self.letters[self.unknown] - self.p)

    @cached_property
    def incidence(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Every pair of a contact and an unknown letter of its word, (i,)."""
        contact, letter = np.nonzero(self.of[:, None] == self.unknown[0])
        return contact, letter

    @cached_property
    def once(self) -> bool:
        """Whether no motion parameter occurs twice in a word."""
        return len(np.unique(self.unknown[0] * self.n + self.operation)) == len(self.operation)

    @cached_property
    def entries(self) -> NDArray[np.intp]:
        """(u, 6, 6): where the block of each unknown letter stands in a matrix (g, 6, n, 6)."""
        six = np.arange(6)
        first = (6 * self.unknown[0][:, None] + six) * self.n + self.operation[:, None]
        return 6 * first[:, :, None] + six

    def constants(self, start: Array) -> Array:
        """All matrices and then their inverses, (2, p + n + 1, 4, 4), of the poses the last row alone.

        Args:
            start: (p, 4, 4): the constant motion parameters.
        """
        stack = np.zeros((2, self.p + self.n + 1, 4, 4))
        stack[..., 3, 3] = 1.0
        stack[:, -1] = _ONE
        stack[0, : self.p] = start
        _invert(start, stack[1, : self.p])
        return stack

    def prefixes(self, constants: Array, T: Array) -> Array:
        """The product of the first j letters of every word, (*, w + 1, g, 4, 4), at the poses T, (*, n, 4, 4)."""
        first = self.p
        last = first + self.n
        lead = T.shape[:-3]
        stack = np.empty((*lead, *constants.shape))
        stack[:] = constants
        stack[..., 0, first:last, :, :] = T
        _invert(T, stack[..., 1, first:last, :, :])
        F = stack.reshape(*lead, 2 * constants.shape[1], 4, 4).take(self._rows, axis=-3)
        products = np.empty((*lead, len(self._rows) + 1, len(self.letters), 4, 4))
        products[..., 0, :, :, :] = _ONE
        for j in range(len(self._rows)):
            np.matmul(products[..., j, :, :, :], F[..., j, :, :, :], out=products[..., j + 1, :, :, :])
        return products

    def products(self, constants: Array, T: Array) -> Array:
        """D_a^-1 D_b of every contact, (*, c, 4, 4), at the poses T, (*, n, 4, 4)."""
        return self.prefixes(constants, T)[..., -1, :, :, :].take(self.of, axis=-3)

    def adjoints(self, prefixes: Array) -> Array:
        """What the body twist of each unknown letter makes of the twist of its word, (*, u, 6, 6), in the frame of a.

        A pose T in F T .. turns by a body twist xi: F T exp(xi) = exp(Ad xi) F T .., with Ad that of F T; T^-1 turns by
        -xi on its left, with Ad that of F.
        """
        P = prefixes.reshape(*prefixes.shape[:-4], -1, 4, 4).take(self._sides, axis=-3)
        P[..., :3] *= self._signs
        R = P[..., :3, :3]
        A = np.zeros((*P.shape[:-2], 6, 6))
        A[..., :3, :3] = R
        A[..., 3:, 3:] = R
        np.matmul((P[..., :3, 3] @ _HAT).reshape(R.shape), R, out=A[..., :3, 3:])
        return A

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """(w, g): where each letter stands among all matrices and then their inverses."""
        return np.ascontiguousarray((self.letters + self.inverse * (self.p + self.n + 1)).T)

    @cached_property
    def _sides(self) -> NDArray[np.intp]:
        """(u,): where the product up to each unknown letter stands among the prefixes, (w + 1, g)."""
        word, place = self.unknown
        return np.asarray((place + ~self.inverse[word, place]) * len(self.letters) + word)

    @cached_property
    def _signs(self) -> Array:
        """(u, 1, 1): -1 of letters that are inverted."""
        return np.where(self.inverse[self.unknown], -1.0, 1.0)[:, None, None]


@remember
def _among(words: Words, contacts: bytes) -> Words:
    """As of `Words.among`: relations are left out in turn of one assembly, again and again."""
    return Words(words.letters, words.inverse, words.of[np.frombuffer(contacts, dtype=np.bool_)], words.p, words.n)


def words_of(letters: NDArray[np.intp], inverse: NDArray[np.bool_], p: int, n: int) -> Words:
    """The words of c contacts, (c, w), those that are the same put together."""
    c, w = letters.shape
    table = np.concatenate([letters, inverse], axis=1)
    different, of = np.unique(table, axis=0, return_inverse=True) if c else (table, np.zeros(0, dtype=np.intp))
    return Words(different[:, :w], different[:, w:] != 0, of.reshape(c), p, n)


def _invert(T: Array, out: Array) -> None:
    """T^-1 = (R^t, -R^t t) of poses (*, 4, 4), but for the last row."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    np.matmul(-Rt, T[..., :3, 3:], out=out[..., :3, 3:])
