"""Whether the pieces of a part hold together."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.convex import separating_axes, shadow
from apo_bench.geometry.solid import Piece

_TOUCHING_M = 2e-5
"""Thinner layers of a solid may be left out between its pieces."""
_MOST_TESTS = 10_000
"""Pairs of pieces with boxes that overlap, of which it is not known yet that they belong together."""


def check_one_piece(pieces: Sequence[Piece], path: Path) -> None:
    """Raise an `InputError` unless every piece touches the others, over some of them."""
    owner = list(range(len(pieces)))
    tests = 0
    low = np.array([piece.center - piece.half for piece in pieces]) - _TOUCHING_M
    high = np.array([piece.center + piece.half for piece in pieces]) + _TOUCHING_M
    for i in range(len(pieces)):
        for k in np.flatnonzero((low[:i] <= high[i]).all(axis=1) & (high[:i] >= low[i]).all(axis=1)):
            a = _root(owner, i)
            b = _root(owner, int(k))
            if a == b:
                continue
            tests += 1
            if tests > _MOST_TESTS:
                raise InputError(f"{path}: whether the pieces touch takes too long to find out; use fewer pieces.")
            if _gap(pieces[i], pieces[int(k)]) < _TOUCHING_M:
                owner[a] = b
    count = len({_root(owner, i) for i in range(len(pieces))})
    if count > 1:
        raise InputError(f"{path}: the pieces make {count} separate solids; a part is one rigid piece.")


def _root(owner: list[int], i: int) -> int:
    while owner[i] != i:
        owner[i] = owner[owner[i]]
        i = owner[i]
    return i


def _gap(a: Piece, b: Piece) -> float:
    """How far two pieces are apart along the direction in which it is most, [m]; negative if they overlap."""
    axes = separating_axes(a, np.eye(3), b, np.eye(3))
    at, reach = shadow(a, np.eye(3), axes)
    on, room = shadow(b, np.eye(3), axes)
    return float((np.abs(at - on) - reach - room).max())
