"""Contact states: which infinitesimal motions the contacts of a part admit, by one linear programme.

Every contact normal n, from what rests into the free side of what moves, admits the motions with n x >= 0. Directions
in which all of them stay closed are *maintaining*, those that only open some *detaching*, all others *constraining*;
for translations the three numbers add up to 3, which leaves ten states. So do rows of six numbers (screws).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, freeze

ANGLE_RAD = 1e-3
"""Directions nearer than this to each other, or to being opposite, are the same where poses are exact."""
_RANK = 1e-4
"""Singular values below this part of the largest are zero."""
_FASTEST = 1e3
"""Bound of the components of a motion that opens contacts at unit speed: a narrower cone counts as flat."""
_LENGTH_M = 0.04
"""Turns are counted by how far they move a point at this distance, so that rows have one unit."""
STATE_LETTERS = {
    (3, 0, 0): "S",
    (2, 1, 0): "A",
    (2, 0, 1): "B",
    (1, 2, 0): "C",
    (1, 1, 1): "D",
    (1, 0, 2): "E",
    (0, 3, 0): "F",
    (0, 2, 1): "G",
    (0, 1, 2): "H",
    (0, 0, 3): "I",
}
"""The ten states of translation, by decreasing freedom: S in the air, A on a plane, E in a through hole, I captured."""


class ContactState(NamedTuple):
    """Degrees of freedom of each kind."""

    maintaining: int
    detaching: int
    constraining: int

    @property
    def letter(self) -> str:
        """The letter of a state of translation; empty for screws."""
        return STATE_LETTERS.get((self.maintaining, self.detaching, self.constraining), "")

    def __str__(self) -> str:
        """`D (1,1,1)`."""
        return f"{self.letter} ({self.maintaining},{self.detaching},{self.constraining})".strip()


@final
@dataclass(frozen=True, eq=False)
class Cone:
    """The motions {x: N x >= 0} that contacts admit: a linear space, and a pointed cone across it."""

    rows: Array
    """N, (k, n)."""
    detachable: NDArray[np.bool_]
    """(k,): contacts that some admissible motion opens; the others are equations."""
    direction: Array
    """A unit motion that opens all of those at once, (n,); zero if there are none."""
    state: ContactState

    def __post_init__(self) -> None:
        freeze(self, rows=(None, None), direction=(self.rows.shape[1],))

    def admits(self, motion: Array, slack: float = ANGLE_RAD) -> bool:
        """Whether a unit motion, (n,), closes in on nothing."""
        return bool((self.rows @ motion >= -slack).all())


def classify(rows: Array) -> Cone:
    """The cone of contacts with these rows, (k, n), and its state.

    The programme asks for a motion that opens as many contacts as it can: max sum s, N x >= s, 0 <= s <= 1. Motions
    that open single contacts add up to one that opens all that can be opened, so every s is 0 or 1.
    """
    n = rows.shape[1]
    if not len(rows):
        return Cone(rows, np.zeros(0, dtype=np.bool_), np.zeros(n), ContactState(n, 0, 0))
    # Equal rows open together, so the programme is solved for one of each.
    different, which = np.unique(np.round(rows, 12) + 0.0, axis=0, return_inverse=True)
    opens, x = _open_rows(different.tobytes(), *different.shape)
    detachable = opens[which.ravel()]
    maintaining = n - row_rank(rows)
    constraining = row_rank(rows[~detachable])
    return Cone(rows, detachable, x, ContactState(maintaining, n - maintaining - constraining, constraining))


@lru_cache(maxsize=1024)
def _open_rows(rows: bytes, k: int, n: int) -> tuple[NDArray[np.bool_], Array]:
    """The programme for rows (k, n): which are opened, (k,), by what unit motion, (n,)."""
    from scipy.optimize import linprog

    N = np.frombuffer(rows).reshape(k, n)
    # Unknowns (x, s): minimise -sum s with s - N x <= 0.
    optimum = linprog(
        np.concatenate([np.zeros(n), -np.ones(k)]),
        A_ub=np.hstack([-N, np.eye(k)]),
        b_ub=np.zeros(k),
        bounds=[(-_FASTEST, _FASTEST)] * n + [(0.0, 1.0)] * k,
        method="highs",
    )
    opens = optimum.x[n:] > 0.5
    x = optimum.x[:n] if opens.any() else np.zeros(n)
    return opens, x / max(float(np.linalg.norm(x)), 1e-300)


def evenly_open(rows: Array) -> Array:
    """The motion, (n,), of components up to 1, that opens contacts with these rows, (k, n), the fastest, counting the
    slowest of them; as a unit vector, or zero if none opens all."""
    from scipy.optimize import linprog

    k, n = rows.shape
    # Unknowns (x, t): maximise t with t <= row . x for every row.
    optimum = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.hstack([-rows, np.ones((k, 1))]),
        b_ub=np.zeros(k),
        bounds=[(-1.0, 1.0)] * n + [(0.0, None)],
        method="highs",
    )
    x = optimum.x[:n] if optimum.x[n] > 1.0 / _FASTEST else np.zeros(n)
    return np.asarray(x / max(float(np.linalg.norm(x)), 1e-300))


def row_rank(rows: Array) -> int:
    """How many rows, (k, n), are independent."""
    if not len(rows):
        return 0
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > _RANK * sizes[0]).sum())


def null_space(rows: Array) -> Array:
    """An orthonormal basis of the motions that keep every contact closed, (m, n)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    return np.linalg.svd(rows)[2][row_rank(rows) :]


def snap_normals(normals: Array, angle_rad: float = ANGLE_RAD) -> Array:
    """Unit normals, (k, 3), of which those within an angle of an earlier one, or of its opposite, become that.

    Between two walls a part is held; between two that are observed a little askew it would seem to be in a wedge.
    """
    axes: list[Array] = []
    snapped = np.empty_like(normals)
    for i, n in enumerate(normals):
        near = [a for a in axes if np.linalg.norm(np.cross(a, n)) < np.sin(angle_rad)]
        axis = max(near, key=lambda a: abs(a @ n), default=None)
        if axis is None:
            axes.append(n)
        snapped[i] = n if axis is None else np.sign(axis @ n) * axis
    return snapped


class Screw(NamedTuple):
    """The state of a part that may also turn."""

    all: ContactState
    """The state in all six degrees of freedom."""
    translation: ContactState
    rotation: ContactState
    """What is left of `all` when translation is taken out."""


def screw_state(points: Array, normals: Array) -> Screw:
    """The state of a part that is touched at points.

    Args:
        points: Corners of the contacts, (k, 3), [m], any frame.
        normals: From what rests into the free side of what moves, (k, 3), one for each point.
    """
    # One row (p x n / L, n) per point, (k, 6): how fast a twist (L w, v) about the middle opens it.
    arms = points - points.mean(axis=0) if len(points) else points
    everything = classify(np.hstack([np.cross(arms, normals) / _LENGTH_M, normals])).state
    translation = classify(np.unique(normals, axis=0)).state
    m = everything.maintaining - translation.maintaining
    c = everything.constraining - translation.constraining
    return Screw(everything, translation, ContactState(m, 3 - m - c, c))
