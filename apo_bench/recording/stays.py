"""Where a part stays: rests between which it is only adjusted are one stay, and what it does between two is a move.

Hands and grippers in view: what takes a part along and then leaves it is no part.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.recording.log import Log, PoseTrack
from apo_bench.recording.rests import RestSpan, consecutive, rests_of
from apo_bench.recording.setup_files import ObjectsFile

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


_FAR_M = 0.03
"""A part that goes less far was not carried; a hand that goes less far did not leave."""
_TOGETHER_M = 0.01
_TOGETHER_RAD = np.radians(15.0)
"""What is held moves in the hand by less, beside noise."""
_FEWEST = 5
"""Frames that both have on the way."""


def hands_of(log: Log, objects: ObjectsFile) -> Mapping[str, str]:
    """Ids that no part is named for and that move as a hand does -> a part that it took along.

    A hand goes the way of a part with it, and away from it while the part rests there. A part that is carried upon
    another one stays with it.
    """
    named = {tracked.id: part for part, tracked in objects.parts.items()}
    strange = [name for name in log.tracks if name not in named and name not in objects.ignored]
    stays = {name: stays_of(name, rests_of(log.tracks[name])) for name in named if strange and name in log.tracks}
    return {
        hand: part
        for hand in strange
        for part in [next((named[name] for name, own in stays.items() if _took(log, hand, name, own)), None)]
        if part is not None
    }


def _took(log: Log, hand: str, part: str, stays: tuple[Stay, ...]) -> bool:
    """Whether something took a part from one stay to the next and went away."""
    for before, after in pairwise(stays):
        t, held = _held(log.tracks[hand], log.tracks[part])
        way = after.rests[0].T[:3, 3] - before.rests[-1].T[:3, 3]
        # the first and last fifth of the way belong to taking and putting down
        edge = 0.2 * (after.begins - before.ends)
        on_way = held[(t > before.ends + edge) & (t < after.begins - edge)]
        if len(on_way) < _FEWEST or np.linalg.norm(way) < _FAR_M:
            continue
        off = pose.log(pose.inverse(on_way[len(on_way) // 2]) @ on_way)
        together = (np.linalg.norm(off[:, :3], axis=1) < _TOGETHER_M) & (
            np.linalg.norm(off[:, 3:], axis=1) < _TOGETHER_RAD
        )
        left = held[(t > after.begins) & (t < after.ends)]
        away = np.linalg.norm(left[:, :3, 3] - on_way[-1][:3, 3], axis=1) > _FAR_M
        if together.mean() > 0.9 and away.any():
            return True
    return False


def _held(hand: PoseTrack, part: PoseTrack) -> tuple[Array, Array]:
    """Times of frames in which both were seen, (n,), and the hand in the frame of the part then, (n, 4, 4)."""
    at = np.clip(np.searchsorted(part.t, hand.t), 1, len(part.t) - 1)
    nearest = at - (hand.t - part.t[at - 1] < part.t[at] - hand.t)
    both = np.abs(part.t[nearest] - hand.t) < np.median(np.diff(part.t))
    return hand.t[both], pose.inverse(part.T[nearest[both]]) @ hand.T[both]
