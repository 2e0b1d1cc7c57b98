"""Readable names of the free directions of a part: shifts along its own axes, and turns about them.

A space of twists is split into pure shifts and, beyond them, turns. Each half gets an orthonormal basis that follows
the axes of the part where possible. The axis of a turn is placed after free shifts are removed from its twist. A
remaining shift along the axis makes the turn a screw.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array, copy_frozen

SHIFT_NAMES = ("x", "y", "z")
"""Names of the shifts along the axes of the part."""
TURN_NAMES = ("roll", "pitch", "yaw")
"""Names of the turns about the axes of the part."""
_LENGTH_M = 0.05
"""Length per radian at which a turn counts as much as a shift."""
_ZERO = 1e-6
"""Components below this fraction of the largest one are rounding."""


@final
@dataclass(frozen=True, eq=False)
class Direction:
    """One free direction of a part, a shift or a turn."""

    twist: Array
    """(6,), body frame of the part: one metre of a shift, or one radian of a turn."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "twist", copy_frozen(self.twist, 6))

    def __str__(self) -> str:
        """Readable form: `x`, `yaw`, `x with y` (oblique), `yaw with z` (a screw)."""
        return " with ".join(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the axes that take part, the largest component first; for a screw also those of its shift.

        The position of a turn's axis is not part of the name.
        """
        words = TURN_NAMES if self.turns else SHIFT_NAMES
        order = np.argsort(-np.abs(self.axis).round(6), kind="stable")
        own = [words[i] for i in order if abs(self.axis[i]) > _ZERO]
        screwed = abs(self.pitch_m) > _ZERO * _LENGTH_M
        return (*own, *(SHIFT_NAMES[i] for i in order if screwed and abs(self.axis[i]) > _ZERO))

    @property
    def turns(self) -> bool:
        """Whether the direction is a turn, possibly a screw; otherwise it is a shift."""
        return bool(np.any(self.twist[3:]))

    @property
    def axis(self) -> Array:
        """Unit vector of the shift, or of the axis of the turn, (3,), frame of the part."""
        return self.twist[3:] if self.turns else self.twist[:3]

    @property
    def point(self) -> Array:
        """The point of the axis of a turn nearest to the origin of the part, (3,), [m]."""
        return np.cross(self.twist[3:], self.twist[:3])

    @property
    def pitch_m(self) -> float:
        """Shift along the axis per radian of a turn, [m]; 0 of a shift."""
        return float(self.twist[:3] @ self.twist[3:])


def directions(space: Array) -> tuple[Direction, ...]:
    """A readable basis of a space of body twists, shifts first, then turns.

    Args:
        space: The twists that span it, as columns, (6, f), [m, rad].
    """
    weights = np.array([1.0, 1.0, 1.0, _LENGTH_M, _LENGTH_M, _LENGTH_M])
    F = _span(space * weights[:, None])
    _, w, Vt = np.linalg.svd(F[3:], full_matrices=True)
    # Combinations of the columns without rotation are pure shifts; the other `turning` ones are turns.
    turning = int(np.count_nonzero(w > _ZERO))
    shifts = _align(_span(F[:3] @ Vt[turning:].T))
    turns = F @ Vt[:turning].T
    axes = [Direction(np.concatenate([axis, np.zeros(3)])) for axis in shifts]
    for axis in _align(_span(turns[3:])):
        turn = turns @ np.linalg.lstsq(turns[3:], axis, rcond=None)[0] * _LENGTH_M
        v = turn[:3] - sum((b @ turn[:3]) * b for b in shifts)
        axes.append(Direction(np.concatenate([np.where(np.abs(v) < _ZERO * _LENGTH_M, 0.0, v), axis])))
    return tuple(axes)


def held(free: Sequence[Direction]) -> tuple[str, ...]:
    """Names of the directions that are not free: all six names, less the first name of each free direction."""
    taken = {direction.names[0] for direction in free}
    return tuple(name for name in (*SHIFT_NAMES, *TURN_NAMES) if name not in taken)


def _span(columns: Array) -> Array:
    """An orthonormal basis of the column space."""
    U, w, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, : np.count_nonzero(w > _ZERO * w.max(initial=0.0))]


def _align(basis: Array) -> list[Array]:
    """An orthonormal basis, (3,) each, of the span of orthonormal columns (3, d), as close to the axes as possible."""
    P = basis @ basis.T
    vectors = list[Array]()
    for _ in range(basis.shape[1]):
        i = int(np.argmax(np.diag(P).round(6)))
        b = P[:, i] / np.linalg.norm(P[:, i])
        P = P - np.outer(b, b)
        b = np.where(np.abs(b) < _ZERO, 0.0, b)
        vectors.append(b / np.linalg.norm(b))
    return vectors
