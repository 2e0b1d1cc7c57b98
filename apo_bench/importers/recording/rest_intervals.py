"""Group rests between which a part is only adjusted into one interval at one place."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.rests import Rest, find_rests, group_consecutive
from apo_bench.importers.recording.tracks import PoseTrack

_ADJUSTED_M = 0.01  # a shorter motion is an adjustment
_ADJUSTED_RAD = np.radians(10.0)  # the same for a rotation
_ADJUSTED_S = 1.5  # longest time of an adjustment


@final
@dataclass(frozen=True, eq=False)
class RestInterval:
    """The rests of a part at one place, with adjustments in between."""

    part: str
    rests: tuple[Rest, ...]

    @property
    def begins(self) -> float:
        return self.rests[0].begins

    @property
    def ends(self) -> float:
        return self.rests[-1].ends

    @property
    def gone(self) -> float:
        """The time until which the part may have been there, [s]: when it was observed again, if it was hidden."""
        return self.rests[-1].gone

    @property
    def seconds(self) -> float:
        """Total duration of the rests, [s]."""
        return sum(rest.ends - rest.begins for rest in self.rests)

    def at(self, t: float) -> Rest:
        """Return the last rest that begins at or before a time, [s]; the first rest if there is none."""
        return next((rest for rest in reversed(self.rests) if rest.begins <= t), self.rests[0])

    def change(self, change: Callable[[Array], Array]) -> "RestInterval":
        """Return the interval with `change` applied to the pose of each rest, (4, 4)."""
        rests = [replace(rest, mean=replace(rest.mean, T=change(rest.T))) for rest in self.rests]
        return replace(self, rests=tuple(rests))


RestIntervals = Mapping[str, tuple[RestInterval, ...]]
"""Part -> its rest intervals in order of time."""


def find_all_intervals(tracks: Mapping[str, PoseTrack]) -> RestIntervals:
    """Return the rest intervals of every part; an empty tuple for a part that never rests."""
    return {part: find_intervals(part, find_rests(track)) for part, track in tracks.items()}


def find_intervals(part: str, rests: Sequence[Rest]) -> tuple[RestInterval, ...]:
    """Return the rest intervals of one part, in order of time."""
    groups = group_consecutive(rests, lambda before, rest: _is_adjusted(before[-1], rest))
    return tuple(RestInterval(part, tuple(group)) for group in groups)


def find_rest_poses(intervals: RestIntervals, t: float) -> Mapping[str, Array]:
    """Return the pose at which every part rests at a time, [s], or rested last: (4, 4), camera from part, [m].

    Before its first rest a part has the pose of that rest.
    """
    return {
        part: next((each for each in reversed(known) if each.begins <= t), known[0]).at(t).T
        for part, known in intervals.items()
        if known
    }


def is_near(twist: Array) -> bool:
    """Whether a body twist, (6,), [m, rad], is small enough for an adjustment."""
    return bool(np.linalg.norm(twist[:3]) < _ADJUSTED_M and np.linalg.norm(twist[3:]) < _ADJUSTED_RAD)


def _is_adjusted(before: Rest, after: Rest) -> bool:
    """Whether two successive rests differ only by a small and short motion."""
    twist = pose.log(pose.inverse(before.T) @ after.T)
    return is_near(twist) and after.begins - before.gone < _ADJUSTED_S
