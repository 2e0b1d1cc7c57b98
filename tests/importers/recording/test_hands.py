"""What takes parts along and leaves them is a hand; a part that is carried upon another one is none."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import pose
from apo_bench.importers.recording.hands import find_hands
from apo_bench.importers.recording.objects_file import ObjectsFile, TrackedPart, name_tracks
from apo_bench.importers.recording.tracks import Log, PoseTrack
from tests.recorded import CAMERA, motion, seen

HELD = pose.at((0.0, 0.0, 0.09), (180.0, 0.0, 20.0))


def objects(*parts: str) -> ObjectsFile:
    return ObjectsFile("objects.toml", {part: TrackedPart(part, np.eye(4)) for part in parts}, frozenset())


def hand_over(name: str) -> PoseTrack:
    """A hand that is with whatever moves, and else waits 0.2 m above."""
    t, T = motion(name)
    aloft = pose.at((0.0, -0.3, 0.3), (180.0, 0.0, 0.0))
    frames = []
    for k in range(len(t)):
        moving = [x for x in T.values() if k and np.abs(x[k] - x[k - 1]).max() > 1e-6]
        frames.append(moving[0][k] @ HELD if moving else aloft)
    return PoseTrack(t, pose.inverse(CAMERA) @ np.array(frames))


@pytest.mark.parametrize("name", ["stick_in_tower", "carried_bridge"])
def test_a_hand_is_told_and_is_no_part(name: str) -> None:
    tracks = seen(name, 0.5)
    log = Log("log.csv", {**tracks, "glove": hand_over(name)}, ())
    told = find_hands(log, objects(*tracks))
    assert set(told) == {"glove"}
    assert set(name_tracks(log, objects(*tracks), told)) == set(tracks)


def test_a_part_that_has_no_name_is_no_hand() -> None:
    """A carried one neither: it stays with what it was put on."""
    tracks = seen("carried_bridge", 0.5)
    for left_out in tracks:
        named = objects(*(part for part in tracks if part != left_out))
        log = Log("log.csv", tracks, ())
        assert find_hands(log, named) == {}
        with pytest.raises(InputError, match="is no part"):
            name_tracks(log, named, find_hands(log, named))
