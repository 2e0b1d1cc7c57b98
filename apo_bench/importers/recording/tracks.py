"""The tracks of a log, the poses of each model over time in the frame of the camera, and checks of units and times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array

_NEAREST_M = 0.02  # smallest median distance to the camera
_FARTHEST_M = 20.0  # largest median distance to the camera
"""Beyond these limits, lengths must be in another unit."""
_FASTEST_S = 2e-4  # smallest median time between frames
_SLOWEST_S = 2.0  # largest median time between frames
"""Beyond these limits, times must be in another unit."""


class PoseTrack(NamedTuple):
    """The poses of one model over time."""

    t: Array
    """(n,), increasing, [s], from the first pose of the log."""
    T: Array
    """(n, 4, 4), camera from model, [m]."""


@final
@dataclass(frozen=True, eq=False)
class Log:
    """All tracks of a log, by id."""

    file: str
    tracks: Mapping[str, PoseTrack]
    notes: tuple[str, ...]
    """How the numbers were read: units, order of the quaternion, direction."""


class LogRows(NamedTuple):
    """The poses of a log in the order of the file."""

    ids: Sequence[str]
    t: Array
    """(n,), [s]."""
    T: Array
    """(n, 4, 4), [m]."""
    places: Sequence[str]
    """Location of each row for messages, as `file, line 3`."""
    notes: Sequence[str]
    """How the numbers were read."""


def sort_rows(file: str, rows: LogRows) -> Log:
    """Sort the rows of a log into tracks, each with increasing times.

    Args:
        file: Name of the log, for messages.

    Raises:
        InputError: The log is empty, a time stands twice or runs backwards, or a unit is another one.
    """
    require(len(rows.t), f"{file}: no pose stands in the file; give a log with one row per pose.")
    tracks = {}
    lost = 0
    # Trackers write the identity when they lose a model; keep it if the model has no other pose.
    is_identity = (np.eye(4) == rows.T).all(axis=(1, 2))
    names = np.array(rows.ids, dtype=object)
    for name in sorted(set(rows.ids)):
        at = np.flatnonzero(names == name)
        backwards = np.flatnonzero(np.diff(rows.t[at]) <= 0.0)
        if len(backwards):
            place = rows.places[at[backwards[0] + 1]]
            raise InputError(
                f"{place}: the time of '{one_line(name, 60)}' stands twice or runs backwards; give one pose for each "
                "time, in the order in which they were recorded."
            )
        if not is_identity[at].all():
            lost += int(is_identity[at].sum())
            at = at[~is_identity[at]]
        tracks[name] = PoseTrack(rows.t[at] - rows.t.min(), rows.T[at])
    distance = np.median(np.linalg.norm(np.concatenate([track.T for track in tracks.values()])[:, :3, 3], axis=1))
    require(
        _NEAREST_M <= distance <= _FARTHEST_M,
        f"{file}: the median distance to the camera is {distance * 1e3:.3g} mm, so its lengths are in another unit; "
        "state it: columns such as x_mm or x_m, or `length` in the camera file.",
    )
    steps = np.concatenate([np.diff(track.t) for track in tracks.values()])
    usual = np.median(steps) if len(steps) else _SLOWEST_S
    require(
        _FASTEST_S <= usual <= _SLOWEST_S,
        f"{file}: the median time between two frames of a track is {usual:.3g} s, so its times are in "
        "another unit; state it: a column such as t_ms or t_s, or `time` in the camera file.",
    )
    left_out = [f"{lost} poses that are the identity left out as lost frames"] if lost else []
    return Log(file, tracks, (*rows.notes, *left_out))
