"""What a tracker wrote: one track per id, poses of its model in the frame of the camera."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array

MOST_POSES = 1_000_000
LARGEST_LOG_BYTES = 200_000_000
_NEAR_M = 0.02
_FAR_M = 20.0
"""Models whose median distance to the camera is less or more were given in another unit."""
_FAST_S = 2e-4
_SLOW_S = 2.0
"""Frames whose median distance in time is less or more have times in another unit."""


class PoseTrack(NamedTuple):
    """One model over time."""

    t: Array
    """(n,), [s], from the first pose of the log, increasing."""
    T: Array
    """(n, 4, 4), camera from model, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Log:
    """A whole log."""

    file: str
    tracks: Mapping[str, PoseTrack]
    notes: tuple[str, ...]
    """How its numbers were read: units, order of the quaternion, direction."""


class LogRows(NamedTuple):
    """Poses as they stand in a file, in its order."""

    ids: Sequence[str]
    t: Array
    """(n,), [s]."""
    T: Array
    """(n, 4, 4), [m]."""
    places: Sequence[str]
    """Where each stands: `file, line 3`."""
    notes: Sequence[str]
    """How they were read."""


def checked_log(file: str, rows: LogRows) -> Log:
    """The tracks of a log, each with increasing times.

    Raises:
        InputError: Nothing stands in it, a time stands twice or runs backwards, or a unit is another one.
    """
    require(len(rows.t), f"{file}: no pose stands in the file; give a log with one row per pose.")
    names, which = np.unique(np.array(rows.ids, dtype=object).astype(str), return_inverse=True)
    tracks = {}
    for i, name in enumerate(names.tolist()):
        at = np.flatnonzero(which == i)
        _check_times(rows, name, at)
        tracks[name] = PoseTrack(rows.t[at] - rows.t.min(), rows.T[at])
    # Metres are not to be read as millimetres, nor milliseconds as seconds, nor the other way round.
    distance = float(np.median(np.linalg.norm(rows.T[:, :3, 3], axis=1)))
    if not _NEAR_M <= distance <= _FAR_M:
        fault = "metres that were read as mm" if distance < _NEAR_M else "mm that were read as metres"
        raise InputError(
            f"{file}: the median distance to the camera is {distance * 1e3:.3g} mm, so these seem to be {fault}; "
            "state the unit: columns such as x_mm or x_m, or `length` in the camera file."
        )
    steps = np.concatenate([np.diff(track.t) for track in tracks.values()])
    require(
        not len(steps) or _FAST_S <= np.median(steps) <= _SLOW_S,
        f"{file}: the median time between two frames of a track is {np.median(steps):.3g} s, so its times seem "
        "to be in another unit; state it: a column such as t_ms or t_s, or `time` in the camera file.",
    )
    return Log(file, MappingProxyType(tracks), tuple(rows.notes))


def _check_times(rows: LogRows, name: str, at: NDArray[np.intp]) -> None:
    steps = np.diff(rows.t[at])
    wrong = np.flatnonzero(steps <= 0.0)
    if not len(wrong):
        return
    k = int(wrong[0])
    fault = "stands twice" if steps[k] == 0.0 else f"is {-steps[k]:.6g} s before the one above it"
    sentence = f"a time of '{one_line(name, 60)}' {fault}; give one pose for each time, sorted"
    if (steps < 0.0).all():
        sentence = (
            f"the times of '{one_line(name, 60)}' run backwards from the first row to the last; give the log in the "
            "order in which it was recorded"
        )
    raise InputError(f"{rows.places[at[k + 1]]}: {sentence}.")
