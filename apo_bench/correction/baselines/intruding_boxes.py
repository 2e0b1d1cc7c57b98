"""Penetration of boxes of parts in contact, as face contact equations, for the baseline `penalty`.

The deepest corner v of one box behind the side n of the other has e = n D_a^-1 D_b v = -depth, the form of Eq. 26, so
the Jacobian of contacts applies. Only the six normals of sides are tested as ways out, not the cross products of edges.
Pieces that are no boxes are ignored.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Assembly, Equations
from apo_bench.geometry import Array, Box, pose


@final
@dataclass(frozen=True, eq=False)
class Meeting:
    """The q pairs of boxes that may penetrate; each may be measured from either side, so words come in both
    directions.
    """

    words: Equations
    """No equations; 2 w words: D_a^-1 D_b of each arc of the relation graph, then D_b^-1 D_a."""
    word: NDArray[np.intp]
    """(q,): the forward word of each pair."""
    centers: Array
    """(2, q, 3): of the boxes of a and of b, in the frames of their parts, [m]."""
    halves: Array
    """(2, q, 3)."""


def meeting(assembly: Assembly, system: Equations) -> Meeting:
    """Every pair of boxes of two parts that an operation brings into contact.

    Args:
        system: All equations, in the order of `assembly.relations()`.
    """
    contacts = [r.contact for r in assembly.relations()]
    first = np.array([arc[0] for arc in assembly.arcs()], np.intp)
    pairs = [
        (w, a, b)
        for w, i in enumerate(first)
        for a in _boxes(assembly, contacts[i].manipulated.part)
        for b in _boxes(assembly, contacts[i].environment.part)
    ]
    letters = system.letters[first]
    inverse = system.inverse[first]
    words = Equations(
        start=system.start,
        letters=np.concatenate([letters, letters[:, ::-1]]),
        inverse=np.concatenate([inverse, ~inverse[:, ::-1]]),
        made=np.tile(system.made[first], 2),
        contact=np.zeros(0, dtype=np.intp),
        plane=np.zeros((0, 4)),
        vertex=np.zeros((0, 4)),
    )
    return Meeting(
        words=words,
        word=np.array([w for w, _, _ in pairs], dtype=np.intp),
        centers=np.array([[a.center for _, a, _ in pairs], [b.center for _, _, b in pairs]]).reshape(2, -1, 3),
        halves=np.array([[a.half for _, a, _ in pairs], [b.half for _, _, b in pairs]]).reshape(2, -1, 3),
    )


def _boxes(assembly: Assembly, part: str) -> list[Box]:
    """The boxes among the pieces of a part."""
    return [piece for piece in assembly.solids[part].pieces if isinstance(piece, Box)]


def intruding(meetings: Meeting, poses: Array) -> Equations:
    """One equation, with e = -depth, for each pair of boxes that penetrate at these poses, (n, 4, 4)."""
    T = _between(meetings.words, poses)[meetings.word]
    depth, axis, sign, reversed_ = _shortest(meetings, T)
    inside = np.flatnonzero(depth > 0)
    side = reversed_[inside].astype(np.intp)  # 0: the side is one of a; 1: one of b
    axis = axis[inside]
    sign = sign[inside]
    plane = np.zeros((len(inside), 4))
    rows = np.arange(len(inside))
    plane[rows, axis] = sign
    plane[:, 3] = -sign * meetings.centers[side, inside, axis] - meetings.halves[side, inside, axis]
    R = np.where(side[:, None, None], np.swapaxes(T[inside, :3, :3], 1, 2), T[inside, :3, :3])
    towards = sign[:, None] * R[rows, axis]
    corner = meetings.centers[1 - side, inside] - np.sign(towards) * meetings.halves[1 - side, inside]
    words = meetings.words
    return Equations(
        start=words.start,
        letters=words.letters,
        inverse=words.inverse,
        made=words.made,
        contact=meetings.word[inside] + side * (len(words.letters) // 2),
        plane=plane,
        vertex=np.column_stack([corner, np.ones(len(inside))]),
    )


def _between(words: Equations, poses: Array) -> Array:
    """The pose of part b in the frame of part a, D_a^-1 D_b, for every arc, (w, 4, 4)."""
    half = len(words.letters) // 2
    F = np.concatenate([words.start, poses, np.eye(4)[None]])[words.letters[:half]]
    F = np.where(words.inverse[:half, :, None, None], pose.inverse(F), F)
    T = np.broadcast_to(np.eye(4), (half, 4, 4))
    for j in range(F.shape[1]):
        T = T @ F[:, j]
    return np.asarray(T)


def _shortest(meetings: Meeting, T: Array) -> tuple[Array, NDArray[np.intp], Array, NDArray[np.bool_]]:
    """The shortest way out of each pair: depth, (q,), axis, sign, and whether the side is one of b.

    Args:
        T: The pose of part b in the frame of part a for each pair, (q, 4, 4).
    """
    a, b = meetings.centers
    half_a, half_b = meetings.halves
    R = T[:, :3, :3]
    # Offset of the centres along the axes of a, and of b; a box has half length |R| half on the axes of the other one.
    way_a = np.einsum("qij,qj->qi", R, b) + T[:, :3, 3] - a
    way_b = -np.einsum("qij,qi->qj", R, way_a)
    spread = np.abs(R)
    depth_a = half_a + np.einsum("qij,qj->qi", spread, half_b) - np.abs(way_a)
    depth_b = half_b + np.einsum("qij,qi->qj", spread, half_a) - np.abs(way_b)
    depth = np.concatenate([depth_a, depth_b], axis=1)
    best = depth.argmin(axis=1)
    rows = np.arange(len(depth))
    way = np.concatenate([way_a, way_b], axis=1)[rows, best]
    return depth[rows, best], best % 3, np.where(way < 0, -1.0, 1.0), best >= 3
