"""Group rests between which a part is only adjusted into one interval at one place."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.geometry import Array, Solid, pose
from apo_bench.importers.recording.folding import forget_turn
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
    def came(self) -> float:
        """The time from which on the part may have been there, [s]: when it was last observed, if it was hidden."""
        return self.rests[0].came

    @property
    def seconds(self) -> float:
        """Total duration of the rests, [s]."""
        return sum(rest.ends - rest.begins for rest in self.rests)

    def at(self, t: float) -> Rest:
        """Return the last rest that begins at or before a time, [s]; the first rest if there is none."""
        return next((rest for rest in reversed(self.rests) if rest.begins <= t), self.rests[0])

    def turn(self, g: Array) -> "RestInterval":
        """Return the interval with the image T g in place of each pose T."""
        A = pose.adjoint(pose.inverse(g))  # a body twist xi at T is Ad(g^-1) xi at T g
        rests = [
            replace(rest, mean=replace(rest.mean, T=rest.T @ g, scatter=A @ rest.mean.scatter @ A.T))
            for rest in self.rests
        ]
        return replace(self, rests=tuple(rests))


RestIntervals = Mapping[str, tuple[RestInterval, ...]]
"""Part -> its rest intervals in order of time."""


def find_all_intervals(tracks: Mapping[str, PoseTrack], solids: Mapping[str, Solid] | None = None) -> RestIntervals:
    """Return the rest intervals of every part; an empty tuple for a part that never rests.

    Args:
        tracks: Folded tracks.
        solids: Shapes of parts, of which those of revolution have no known turn about their axis.
    """
    known = {part: find_rests(track) for part, track in tracks.items()}
    for part, rests in known.items():
        if solids and part in solids:
            known[part] = tuple(
                replace(rest, mean=replace(rest.mean, scatter=forget_turn(solids[part], rest.mean.scatter)))
                for rest in rests
            )
    return {part: find_intervals(part, rests) for part, rests in known.items()}


def find_intervals(part: str, rests: Sequence[Rest]) -> tuple[RestInterval, ...]:
    """Return the rest intervals of one part, in order of time."""
    groups = group_consecutive(rests, lambda before, rest: _is_adjusted(before[-1], rest))
    return tuple(RestInterval(part, tuple(group)) for group in groups)


def find_rest_poses(
    intervals: RestIntervals,
    t: float,
    ended: Collection[RestInterval | None] = (),
    later: Collection[RestInterval | None] = (),
    settled: Collection[str] = (),
) -> Poses:
    """Return the pose at which every part rests at a time, [s], or rested last: (4, 4), camera from part, [m].

    Before its first rest a part has the pose of that rest.

    Args:
        ended: Intervals in which earlier operations left their parts, even if these were hidden until later.
        later: Intervals in which later operations left their parts.
        settled: Parts that no later operation moves: where they rest after they were hidden, they were all the time.
    """
    poses = {}
    for part, known in intervals.items():
        arrived = [each for each in known if (each.came if part in settled else each.begins) <= t or each in ended]
        there = [each for each in arrived if each not in later]
        poses[part] = (there[-1] if there else known[0]).at(t).T
    return poses


def is_near(twist: Array) -> bool:
    """Whether a body twist, (6,), [m, rad], is small enough for an adjustment."""
    return bool(np.linalg.norm(twist[:3]) < _ADJUSTED_M and np.linalg.norm(twist[3:]) < _ADJUSTED_RAD)


def _is_adjusted(before: Rest, after: Rest) -> bool:
    """Whether two successive rests differ only by a small and short motion."""
    twist = pose.log(pose.inverse(before.T) @ after.T)
    return is_near(twist) and after.begins - before.gone < _ADJUSTED_S
