"""What a tracker wrote: one track per id, poses of its model in the frame of the camera."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array

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


def sort_rows(file: str, rows: LogRows) -> Log:
    """The tracks of a log, each with increasing times.

    Raises:
        InputError: Nothing stands in it, a time stands twice or runs backwards, or a unit is another one.
    """
    require(len(rows.t), f"{file}: no pose stands in the file; give a log with one row per pose.")
    names, which = np.unique(np.array(rows.ids, dtype=object).astype(str), return_inverse=True)
    tracks = {}
    # Trackers write the identity for a frame in which they lost a model. A track of nothing else is a model that stays.
    identity = (np.eye(4) == rows.T).all(axis=(1, 2))
    lost = 0
    for i, name in enumerate(names.tolist()):
        at = np.flatnonzero(which == i)
        _check_times(rows, name, at)
        if not identity[at].all():
            lost += int(identity[at].sum())
            at = at[~identity[at]]
        tracks[name] = PoseTrack(rows.t[at] - rows.t.min(), rows.T[at])
    distance = float(np.median(np.linalg.norm(rows.T[~identity if lost else slice(None), :3, 3], axis=1)))
    require(
        _NEAR_M <= distance <= _FAR_M,
        f"{file}: the median distance to the camera is {distance * 1e3:.3g} mm, so its lengths are in another unit; "
        "state it: columns such as x_mm or x_m, or `length` in the camera file.",
    )
    steps = [float(step) for track in tracks.values() for step in np.diff(track.t)]
    usual = median(steps) if steps else _SLOW_S
    require(
        _FAST_S <= usual <= _SLOW_S,
        f"{file}: the median time between two frames of a track is {usual:.3g} s, so its times are in "
        "another unit; state it: a column such as t_ms or t_s, or `time` in the camera file.",
    )
    left_out = [f"{lost} poses that are the identity left out as lost frames"] if lost else []
    return Log(file, MappingProxyType(tracks), (*rows.notes, *left_out))


def _check_times(rows: LogRows, name: str, at: NDArray[np.intp]) -> None:
    steps = np.diff(rows.t[at])
    wrong = np.flatnonzero(steps <= 0.0)
    if len(wrong):
        k = int(wrong[0])
        fault = "stands twice" if steps[k] == 0.0 else f"is {-steps[k]:.6g} s before the one above it"
        raise InputError(
            f"{rows.places[at[k + 1]]}: a time of '{one_line(name, 60)}' {fault}; give one pose for each time, in the "
            "order in which they were recorded."
        )
