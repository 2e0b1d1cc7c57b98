"""The product of poses in each contact equation, D_a^-1 D_b, at the poses of many observations at once.

Such a product is a word, and the poses in it, start poses and operations' poses or their inverses, are its letters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, remember

_ONE = np.eye(4)


@final
@dataclass(frozen=True, eq=False)
class Words:
    """c words of at most w letters, in the motion parameters of n operations and p constants."""

    letters: NDArray[np.intp]
    """(c, w): as in `Equations`: p constants, then n poses, then the identity as padding."""
    inverse: NDArray[np.bool_]
    """(c, w): which letters are inverted."""
    p: int
    n: int

    def __len__(self) -> int:
        return len(self.letters)

    def among(self, contacts: NDArray[np.bool_]) -> Words:
        """The words of these contacts, (c,), alone."""
        return _among(self, contacts.tobytes())

    @cached_property
    def columns(self) -> NDArray[np.intp]:
        """(c, w): the operation of each letter; n for letters that are constants or padding."""
        k = self.letters - self.p
        return np.where((k >= 0) & (k < self.n), k, self.n)

    @cached_property
    def signed_columns(self) -> NDArray[np.intp]:
        """(c, w): the column of each letter, behind all columns where the sign changes."""
        return self.columns + self.inverse * (self.n + 1)

    @cached_property
    def once(self) -> bool:
        """Whether no motion parameter occurs twice in a word."""
        ordered = np.sort(self.columns, axis=1)
        return not bool(((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] < self.n)).any())

    @cached_property
    def sides(self) -> NDArray[np.intp]:
        """(c, w): where the points and planes of each letter stand among those of all, (w + 1, c)."""
        c, w = self.letters.shape
        return (np.arange(w) + ~self.inverse) * c + np.arange(c)[:, None]

    @cached_property
    def table(self) -> NDArray[np.intp]:
        """(3, c, w): letters, columns and inverse (0 or 1), as kernels take them."""
        return np.array([self.letters, self.columns, self.inverse], dtype=np.intp)

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

    def factors(self, constants: Array, T: Array) -> Array:
        """Every letter of every word, (*, c, w, 4, 4), at the poses T, (*, n, 4, 4)."""
        first = self.p
        last = first + self.n
        stack = np.empty((*T.shape[:-3], *constants.shape))
        stack[:] = constants
        stack[..., 0, first:last, :, :] = T
        _invert(T, stack[..., 1, first:last, :, :])
        return stack.reshape(*T.shape[:-3], 2 * constants.shape[1], 4, 4).take(self._rows, axis=-3)

    def products(self, constants: Array, T: Array) -> Array:
        """D_a^-1 D_b of every contact, (*, c, 4, 4), at the poses T, (*, n, 4, 4)."""
        F = self.factors(constants, T)
        M = np.broadcast_to(_ONE, (*F.shape[:-3], 4, 4))
        for j in range(F.shape[-3]):
            M = M @ F[..., j, :, :] if j else F[..., j, :, :]
        return np.asarray(M)

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        """(c, w): where each letter stands among all matrices and then their inverses."""
        return self.letters + self.inverse * (self.p + self.n + 1)


@remember
def _among(words: Words, contacts: bytes) -> Words:
    """As of `Words.among`: relations are left out in turn of one assembly, again and again."""
    kept = np.frombuffer(contacts, dtype=np.bool_)
    return Words(words.letters[kept], words.inverse[kept], words.p, words.n)


def _invert(T: Array, out: Array) -> None:
    """T^-1 = (R^t, -R^t t) of poses (*, 4, 4), but for the last row."""
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = Rt
    np.matmul(-Rt, T[..., :3, 3:], out=out[..., :3, 3:])
