"""Hands and grippers in view: what takes a part along and then leaves it is no part."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.objects_file import ObjectsFile
from apo_bench.importers.recording.rests import rests_of
from apo_bench.importers.recording.stays import Stay, stays_of
from apo_bench.importers.recording.tracks import Log, PoseTrack

_FAR_M = 0.03
"""A part that goes less far was not carried; a hand that goes less far did not leave."""
_TOGETHER_M = 0.01
_TOGETHER_RAD = np.radians(15.0)
"""What is held moves in the hand by less, beside noise."""
_FEWEST = 5
"""Frames that both have on the way."""


def find_hands(log: Log, objects: ObjectsFile) -> Mapping[str, str]:
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
