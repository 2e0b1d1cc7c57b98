"""Where a part stays: rests between which it is only adjusted are one stay, and what it does between two is a move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.recording.log import PoseTrack
from apo_bench.recording.rests import RestSpan, consecutive, rests_of

_ADJUSTED_M = 0.01
_ADJUSTED_RAD = np.radians(10.0)
"""A rest that is nearer to the one before is the same stay."""
_ADJUSTED_S = 1.5
"""Longest time of such an adjustment."""


@final
@dataclass(frozen=True, eq=False)
class Stay:
    """A part at one place, adjusted or not."""

    part: str
    rests: tuple[RestSpan, ...]

    @property
    def begins(self) -> float:
        return self.rests[0].begins

    @property
    def ends(self) -> float:
        return self.rests[-1].ends

    @property
    def seconds(self) -> float:
        return sum(rest.seconds for rest in self.rests)

    def at(self, t: float) -> RestSpan:
        """The rest at a time, else the last one before it."""
        return next((rest for rest in reversed(self.rests) if rest.begins <= t), self.rests[0])


Stays = Mapping[str, tuple[Stay, ...]]
"""Part -> where it stayed, in order of time."""


def all_stays(tracks: Mapping[str, PoseTrack]) -> Stays:
    """Where every part of a log stayed; nowhere, if it never rests."""
    return {part: stays_of(part, rests_of(track)) for part, track in tracks.items()}


def stays_of(part: str, rests: Sequence[RestSpan]) -> tuple[Stay, ...]:
    """The stays of a part, in order of time."""
    groups = consecutive(rests, lambda before, rest: _is_adjusted(before[-1], rest))
    return tuple(Stay(part, tuple(together)) for together in groups)


def poses_at(stays: Stays, t: float) -> Mapping[str, Array]:
    """Where every part is at a time, in the frame of the camera: of one that moves, where it was last; (4, 4), [m]."""
    return {
        part: next((stay for stay in reversed(known) if stay.begins <= t), known[0]).at(t).T
        for part, known in stays.items()
        if known
    }


def _is_adjusted(before: RestSpan, after: RestSpan) -> bool:
    off = pose.log(pose.inverse(before.T) @ after.T)
    near = np.linalg.norm(off[:3]) < _ADJUSTED_M and np.linalg.norm(off[3:]) < _ADJUSTED_RAD
    return bool(near and after.begins - before.ends < _ADJUSTED_S)
