"""Where a part stays: rests between which it is only adjusted are one stay, and what it does between two is a move."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import final

import numpy as np

from apo_bench.geometry import Array, Solid, nearest_alike, pose
from apo_bench.importers.recording.rests import RestSpan, consecutive, rests_of
from apo_bench.importers.recording.tracks import PoseTrack

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
    def gone(self) -> float:
        """When the part may have been there last: until it was seen again, if it was hidden."""
        return self.rests[-1].gone

    @property
    def seconds(self) -> float:
        return sum(rest.seconds for rest in self.rests)

    def at(self, t: float) -> RestSpan:
        """The rest at a time, else the last one before it."""
        return next((rest for rest in reversed(self.rests) if rest.begins <= t), self.rests[0])

    def moved(self, change: Callable[[Array], Array]) -> "Stay":
        """The same at other poses (4, 4)."""
        rests = [replace(rest, mean=replace(rest.mean, T=change(rest.T))) for rest in self.rests]
        return replace(self, rests=tuple(rests))


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
    return is_near(off) and after.begins - before.gone < _ADJUSTED_S


def is_near(twist: Array) -> bool:
    """Whether a part that moves by a body twist (6,) is only adjusted."""
    return bool(np.linalg.norm(twist[:3]) < _ADJUSTED_M and np.linalg.norm(twist[3:]) < _ADJUSTED_RAD)


def is_flip(solid: Solid, twist: Array) -> bool:
    """Whether a part that moves by a body twist (6,) is where it was, but turned by one of its symmetries."""
    alike = nearest_alike(solid, np.asarray(pose.exp(twist)), np.eye(4))
    return is_near(pose.log(alike)) and not is_near(twist)


def flip_time(solid: Solid, known: Sequence[Stay]) -> float | None:
    """When a part is seen flipped by one of its symmetries, with nothing between, [s]; None if it never is."""
    return next(
        (
            after.begins
            for before, after in pairwise(known)
            if is_flip(solid, pose.log(pose.inverse(before.rests[-1].T) @ after.rests[0].T))
        ),
        None,
    )
