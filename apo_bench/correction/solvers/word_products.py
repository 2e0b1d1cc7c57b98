"""Products of poses in the contact equations, D_a^-1 D_b, and their derivatives by the poses of operations.

Such a product is a word; its letters are start poses and poses of operations, or their inverses. Contacts between the
same parts have the same word, which is multiplied once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import ADJOINTS, Array, remember

_ONE = np.eye(4)
"""The identity pose."""
_HAT = np.ascontiguousarray(ADJOINTS[3:, :3, :3]).reshape(3, 9)
"""The cross-product matrix of t is sum_i t_i _HAT[i], flattened to (9,)."""


@final
@dataclass(frozen=True, eq=False)
class Words:
    """The g different words of c contacts, of at most w letters, in the poses of n operations and p constants."""

    letters: NDArray[np.intp]
    """(g, w), as in `Equations`: indices of p constants, then n poses, then the identity as padding."""
    inverse: NDArray[np.bool_]
    """(g, w): which letters are inverted."""
    of: NDArray[np.intp]
    """(c,): the word of each contact."""
    p: int
    """Number of constants, the start poses."""
    n: int
    """Number of operations."""

    def __len__(self) -> int:
        return len(self.of)

    def among(self, contacts: NDArray[np.bool_]) -> Words:
        """The words of the chosen contacts, (c,), alone."""
        return _among(self, contacts.tobytes())

    @cached_property
    def unknown(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The word and the place in it, (u,) each, of every letter that is the pose of an operation."""
        word, place = np.nonzero((self.letters >= self.p) & (self.letters < self.p + self.n))
        return word, place

    @cached_property
    def operation(self) -> NDArray[np.intp]:
        """(u,): the operation of each unknown letter."""
        return np.asarray(self.letters[self.unknown] - self.p)

    @cached_property
    def incidence(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """All pairs of a contact and an unknown letter of its word, as two index arrays, (i,) each."""
        contact, letter = np.nonzero(self.of[:, None] == self.unknown[0])
        return contact, letter

    @cached_property
    def once(self) -> bool:
        """Whether no operation occurs twice in a word."""
        return len(np.unique(self.unknown[0] * self.n + self.operation)) == len(self.operation)

    @cached_property
    def entries(self) -> NDArray[np.intp]:
        """(u, 6, 6): flat indices of the block of each unknown letter in an array (g, 6, n, 6)."""
        six = np.arange(6)
        first = (6 * self.unknown[0][:, None] + six) * self.n + self.operation[:, None]
        return 6 * first[:, :, None] + six

    def constants(self, start: Array) -> Array:
        """Matrices of all letters, and their inverses, (2, p + n + 1, 4, 4); of the operations only the last row is
        filled in.

        Args:
            start: (p, 4, 4): the start poses.
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
        """The derivative of the twist of its word by the body twist of each unknown letter, (*, u, 6, 6), in the frame
        of a.

        For a pose T in F T .. with body twist xi: F T exp(xi) = exp(Ad xi) F T .., with Ad that of F T. T^-1 has -xi on
        its left, with Ad that of F.
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
        """(w, g): index of each letter among all matrices followed by their inverses."""
        return np.ascontiguousarray((self.letters + self.inverse * (self.p + self.n + 1)).T)

    @cached_property
    def _sides(self) -> NDArray[np.intp]:
        """(u,): index of the product up to each unknown letter among the prefixes, (w + 1, g)."""
        word, place = self.unknown
        # + ~inverse: the product includes the letter itself unless that is inverted.
        return np.asarray((place + ~self.inverse[word, place]) * len(self.letters) + word)

    @cached_property
    def _signs(self) -> Array:
        """(u, 1, 1): -1 for inverted letters, else 1."""
        return np.where(self.inverse[self.unknown], -1.0, 1.0)[:, None, None]


@remember
def _among(words: Words, contacts: bytes) -> Words:
    """`Words.among`, cached, since the same relations are left out again and again."""
    return Words(words.letters, words.inverse, words.of[np.frombuffer(contacts, dtype=np.bool_)], words.p, words.n)


def words_of(letters: NDArray[np.intp], inverse: NDArray[np.bool_], p: int, n: int) -> Words:
    """Collect the different words of c contacts, whose letters are (c, w)."""
    c, w = letters.shape
    table = np.concatenate([letters, inverse], axis=1)
    different, of = np.unique(table, axis=0, return_inverse=True) if c else (table, np.zeros(0, dtype=np.intp))
    return Words(different[:, :w], different[:, w:] != 0, of.reshape(c), p, n)


def _invert(T: Array, out: Array) -> None:
    """Write T^-1 = (R^t, -R^t t) of poses, (*, 4, 4), to `out`, except the last row."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    np.matmul(-Rt, T[..., :3, 3:], out=out[..., :3, 3:])
