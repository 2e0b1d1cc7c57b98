"""The tracks of a log: the poses of each id over time in the frame of the camera, without lost frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array

NEAREST_M = 0.02  # smallest median distance to the camera
FARTHEST_M = 20.0  # largest median distance to the camera
"""Beyond these limits, lengths must be in another unit."""
FASTEST_S = 2e-4  # smallest median time between frames
SLOWEST_S = 2.0  # largest median time between frames
"""Beyond these limits, times must be in another unit."""
_BACK_S = 1.0
"""Largest time by which a row may be older than one before it; rows are sorted."""
_SMALL_M = 2e-3  # largest step between two frames of a part that may rest
_MOVING = 0.2
"""Poses have noise if more than this share of the small steps between frames is not zero."""
_JUMP_M = 0.05  # a pose that recurs exactly marks lost frames if the part jumps there by more
_RECURS = 3  # and if it recurs so often


class PoseTrack(NamedTuple):
    """The poses of one model over time."""

    t: Array
    """(n,), increasing, [s], from the first pose of the log."""
    T: Array
    """(n, 4, 4), camera from model, [m]."""


class Candidates(NamedTuple):
    """The poses of one id, of which several may stand at one time if the id is that of several objects."""

    t: Array
    """(n,), not decreasing, [s]."""
    T: Array
    """(n, 4, 4), [m]."""
    score: Array
    """(n,), of the estimator; 0 where the log has none."""
    lost: Mapping[str, int]
    """Kind of lost frame -> number of frames that were left out."""


@final
@dataclass(frozen=True, eq=False)
class Log:
    """All poses of a log, by id."""

    file: str
    candidates: Mapping[str, Candidates]
    notes: tuple[str, ...]
    """How the numbers were read: format, units, order of the quaternion, direction."""
    broken: int
    """Number of rows that were left out, as they have another number of cells."""

    @property
    def tracks(self) -> Mapping[str, PoseTrack]:
        """The track of each id with one pose for each time."""
        return {name: best_poses(poses) for name, poses in self.candidates.items()}


class LogRows(NamedTuple):
    """The poses of a log in the order of the file."""

    ids: Sequence[str]
    t: Array
    """(n,), [s]."""
    T: Array
    """(n, 4, 4), [m]; the identity where lost."""
    lost: NDArray[np.bool_]
    """(n,), whether the row holds no pose, or is marked as not valid."""
    score: Array
    """(n,)."""
    places: Sequence[str]
    """Location of each row for messages, as `file, line 3`."""
    notes: Sequence[str]
    """How the numbers were read."""


def sort_rows(file: str, rows: LogRows, broken: int = 0) -> Log:
    """Sort the rows of a log by id and time, and leave out lost frames.

    Args:
        file: Name of the log, for messages.

    Raises:
        InputError: No pose is valid, times run far backwards, or a unit is another one.
    """
    names = np.array(rows.ids, dtype=object)
    timed = np.isfinite(rows.t)
    first = float(rows.t[timed].min()) if timed.any() else 0.0
    candidates = {}
    for name in sorted({*rows.ids}):
        at = np.flatnonzero((names == name) & timed)
        back = np.maximum.accumulate(rows.t[at]) - rows.t[at]
        if len(at) and back.max() > _BACK_S:
            place = rows.places[at[int(np.argmax(back))]]
            raise InputError(
                f"{place}: the time of '{one_line(name, 60)}' runs backwards by {back.max():.3g} s; give one log, "
                "in the order in which it was recorded."
            )
        at = at[np.argsort(rows.t[at], kind="stable")]
        kept, lost = _drop_lost(rows.t[at], rows.T[at], rows.lost[at])
        at = at[kept]
        if len(at):
            candidates[name] = Candidates(rows.t[at] - first, rows.T[at], rows.score[at], lost)
    require(candidates, f"{file}: every frame is marked as lost; give a log with poses of parts.")
    distance = float(np.median(np.linalg.norm(np.concatenate([c.T for c in candidates.values()])[:, :3, 3], axis=1)))
    require(
        NEAREST_M <= distance <= FARTHEST_M,
        f"{file}: the median distance to the camera is {distance * 1e3:.3g} mm, so its lengths are in another unit; "
        "state it: columns such as x_mm or x_m, or `length` in the camera file.",
    )
    steps = np.concatenate([np.diff(np.unique(c.t)) for c in candidates.values()])
    usual = np.median(steps) if len(steps) else SLOWEST_S
    require(
        FASTEST_S <= usual <= SLOWEST_S,
        f"{file}: the median time between two frames of a track is {usual:.3g} s, so its times are in "
        "another unit; state it: a column such as t_ms or t_s, or `time` in the camera file.",
    )
    return Log(file, candidates, tuple(rows.notes), broken)


def best_poses(candidates: Candidates) -> PoseTrack:
    """Return one pose for each time, that with the best score, and the first of several with the same."""
    order = np.lexsort((-candidates.score, candidates.t))
    t, first = np.unique(candidates.t[order], return_index=True)
    return PoseTrack(t, candidates.T[order][first])


def _drop_lost(t: Array, T: Array, lost: NDArray[np.bool_]) -> tuple[NDArray[np.int64], Mapping[str, int]]:
    """Return the indices of valid frames of one id, and how many of each kind were left out.

    Trackers mark lost frames in many ways: no numbers, a column, a position of zero, one pose that recurs exactly, or
    the last pose for as long as the object is lost. Poses without noise may recur and stand still, so the last two
    count only where poses have noise.
    """
    counts = {"not valid": int(lost.sum())}
    kept = np.flatnonzero(~lost)
    # The base of a frame lies in its origin in every frame; elsewhere a position of exactly zero is no position.
    zero = (T[kept, :3, 3] == 0.0).all(axis=1)
    if not zero.all():
        counts["zero or identity"] = int(zero.sum())
        kept = kept[~zero]
    if len(kept) > 3 and len(np.unique(t[kept])) == len(kept):
        flat = T[kept, :3].reshape(len(kept), 12)
        same = np.concatenate([[False], (np.diff(flat, axis=0) == 0.0).all(axis=1)])
        small = np.linalg.norm(np.diff(flat[:, 3::4], axis=0), axis=1) < _SMALL_M
        if small.any() and (~same[1:][small]).mean() > _MOVING:
            recurs = _find_recurring(flat, same)
            counts["one pose again and again"] = int(recurs.sum())
            counts["the last pose again"] = int((same & ~recurs).sum())
            kept = kept[~recurs & ~same]
    return kept.astype(np.int64), {kind: n for kind, n in counts.items() if n}


def _find_recurring(flat: Array, same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which frames, (n, 12), have a pose that recurs exactly, to which the part jumps each time."""
    _, key = np.unique(flat, axis=0, return_inverse=True)
    key = key.reshape(-1)
    starts = np.flatnonzero(~same)
    jumped = np.linalg.norm(np.diff(flat[:, 3::4], axis=0, prepend=flat[:1, 3::4]), axis=1) > _JUMP_M
    recurring = [k for k in np.unique(key[starts]) if np.sum(jumped[starts] & (key[starts] == k)) >= _RECURS]
    return np.isin(key, recurring)


def span_of(track: PoseTrack) -> float:
    """Return the usual time between two frames of a track, [s]."""
    return max(float(np.median(np.diff(track.t))), 1e-6) if len(track.t) > 1 else SLOWEST_S
