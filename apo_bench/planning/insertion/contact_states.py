"""Contact states: classify the infinitesimal motions that the contacts of a part admit, by one linear programme.

A contact normal n, from the resting part towards the moving one, admits the motions with n x >= 0. A direction in which
all contacts stay closed is *maintaining*, one that only opens some is *detaching*, any other is *constraining*. For
translations the three numbers add up to 3, which leaves ten states. Rows of six numbers (screws) are classified alike.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, freeze

ANGLE_RAD = 1e-3
"""Directions within this angle are parallel (or opposite) if poses are exact."""
_RANK = 1e-4
"""Singular values below this share of the largest count as zero."""
_FASTEST = 1e3
"""Bound of the components of a motion that opens contacts at unit speed: a narrower cone counts as flat."""
_LENGTH_M = 0.04
"""Rotations count by the motion of a point at this distance, so that all entries of a screw are lengths."""
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
"""(maintaining, detaching, constraining) -> letter of a state of translation.

By decreasing freedom; for example S: in the air, A: on a plane, E: in a through hole, I: captured.
"""


class ContactState(NamedTuple):
    """Numbers of maintaining, detaching and constraining degrees of freedom."""

    maintaining: int
    detaching: int
    constraining: int

    @property
    def letter(self) -> str:
        """The letter of a state of translation; empty for screws."""
        return STATE_LETTERS.get((self.maintaining, self.detaching, self.constraining), "")

    def __str__(self) -> str:
        """The letter and the three numbers, such as `D (1,1,1)`."""
        return f"{self.letter} ({self.maintaining},{self.detaching},{self.constraining})".strip()


@final
@dataclass(frozen=True, eq=False)
class Cone:
    """The motions {x: N x >= 0} that contacts admit: a linear space, and a pointed cone across it."""

    rows: Array
    """N, (k, n)."""
    detachable: NDArray[np.bool_]
    """(k,): whether some admissible motion opens the contact; all others stay closed (N x = 0)."""
    direction: Array
    """A unit motion that opens all of those at once, (n,); zero if there are none."""
    state: ContactState

    def __post_init__(self) -> None:
        freeze(self, rows=(None, None), direction=(self.rows.shape[1],))

    def admits(self, motion: Array, slack: float = ANGLE_RAD) -> bool:
        """Whether a unit motion, (n,), closes in on no contact by more than `slack`."""
        return bool((self.rows @ motion >= -slack).all())


def classify_motions(rows: Array) -> Cone:
    """Classify the contacts with normals or screws `rows`, (k, n): the cone of admissible motions, and its state.

    The linear programme seeks a motion that opens as many contacts as possible: max sum s, N x >= s, 0 <= s <= 1.
    Motions that open single contacts add up to one that opens all that can open, so every s is 0 or 1.
    """
    n = rows.shape[1]
    if not len(rows):
        return Cone(rows, np.zeros(0, dtype=np.bool_), np.zeros(n), ContactState(n, 0, 0))
    # Equal rows open together, so the programme is solved for one of each.
    different, which = np.unique(np.round(rows, 12) + 0.0, axis=0, return_inverse=True)
    opens, x = _open_rows(different.tobytes(), *different.shape)
    detachable = opens[which.ravel()]
    # Motions along all contacts; directions across contacts that cannot open; the rest is detaching.
    maintaining = n - compute_row_rank(rows)
    constraining = compute_row_rank(rows[~detachable])
    return Cone(rows, detachable, x, ContactState(maintaining, n - maintaining - constraining, constraining))


@lru_cache(maxsize=1024)
def _open_rows(rows: bytes, k: int, n: int) -> tuple[NDArray[np.bool_], Array]:
    """Solve the programme of `classify_motions`; the rows come as bytes so that the result can be cached.

    Returns:
        (opens, x): which rows open, (k,), and the unit motion that opens them, (n,), zero if none opens.
    """
    from scipy.optimize import linprog

    N = np.frombuffer(rows).reshape(k, n)
    # Unknowns (x, s): minimise -sum s with s - N x <= 0.
    optimum = linprog(
        np.concatenate([np.zeros(n), -np.ones(k)]),
        A_ub=np.hstack([-N, np.eye(k)]),
        b_ub=np.zeros(k),
        bounds=[(-_FASTEST, _FASTEST)] * n + [(0.0, 1.0)] * k,  # of x, then of s
        method="highs",
    )
    opens = optimum.x[n:] > 0.5  # every s is 0 or 1
    x = optimum.x[:n] if opens.any() else np.zeros(n)
    return opens, x / max(float(np.linalg.norm(x)), 1e-300)


def find_even_opening(rows: Array) -> Array:
    """The unit motion, (n,), that opens contacts `rows`, (k, n), evenly: the slowest opens as fast as possible.

    The programme is max t, N x >= t, |x_i| <= 1. The result is zero if no motion opens all contacts.
    """
    from scipy.optimize import linprog

    k, n = rows.shape
    # Unknowns (x, t): maximise t with t <= row . x for every row.
    optimum = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=np.hstack([-rows, np.ones((k, 1))]),
        b_ub=np.zeros(k),
        bounds=[(-1.0, 1.0)] * n + [(0.0, None)],  # of x, then of t
        method="highs",
    )
    x = optimum.x[:n] if optimum.x[n] > 1.0 / _FASTEST else np.zeros(n)
    return np.asarray(x / max(float(np.linalg.norm(x)), 1e-300))


def compute_row_rank(rows: Array) -> int:
    """Number of independent rows of (k, n)."""
    if not len(rows):
        return 0
    sizes = np.linalg.svd(rows, compute_uv=False)
    return int((sizes > _RANK * sizes[0]).sum())


def compute_null_space(rows: Array) -> Array:
    """An orthonormal basis, (m, n), of the motions that keep all contacts `rows`, (k, n), closed."""
    if not len(rows):
        return np.eye(rows.shape[1])
    return np.linalg.svd(rows)[2][compute_row_rank(rows) :]


def snap_normals(normals: Array, angle_rad: float = ANGLE_RAD) -> Array:
    """Unit normals, (k, 3), in which nearly parallel ones are exactly parallel.

    A normal within `angle_rad` of an earlier one, or of its opposite, takes that direction and keeps its own sign. Two
    observed walls of a slot would otherwise form a wedge, which holds the part less than a slot does.
    """
    axes: list[Array] = []  # directions taken so far, up to sign
    snapped = np.empty_like(normals)
    for i, n in enumerate(normals):
        near = [a for a in axes if np.linalg.norm(np.cross(a, n)) < np.sin(angle_rad)]
        axis = max(near, key=lambda a: abs(a @ n), default=None)  # the most parallel one
        if axis is None:
            axes.append(n)
        snapped[i] = n if axis is None else np.sign(axis @ n) * axis
    return snapped


class Screw(NamedTuple):
    """The contact state of a part that may also rotate."""

    all: ContactState
    """The state in all six degrees of freedom."""
    translation: ContactState
    rotation: ContactState
    """`all` less `translation`; the three numbers add up to 3."""


def classify_with_rotations(points: Array, normals: Array) -> Screw:
    """The contact state, with rotations, of a part that is touched at points.

    Args:
        points: Corners of the contacts, (k, 3), [m], any frame.
        normals: Unit normals from the resting part towards the moving one, (k, 3), one per point.
    """
    # One row (p x n / L, n) per point, (k, 6): the speed at which a twist (L w, v) about the mean point opens it.
    arms = points - points.mean(axis=0) if len(points) else points
    everything = classify_motions(np.hstack([np.cross(arms, normals) / _LENGTH_M, normals])).state
    translation = classify_motions(np.unique(normals, axis=0)).state
    m = everything.maintaining - translation.maintaining
    c = everything.constraining - translation.constraining
    return Screw(everything, translation, ContactState(m, 3 - m - c, c))
