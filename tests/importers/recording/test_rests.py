"""Where a part rests and stays: how long, at which pose, and what is too short to be a rest."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.rest_intervals import find_intervals, find_rest_poses
from apo_bench.importers.recording.rests import LEAST_REST_S, find_rests
from apo_bench.importers.recording.tracks import PoseTrack
from tests.recorded import RATE_HZ

BEFORE = pose.at((0.1, -0.2, 0.9), (10.0, 20.0, 30.0))


def at_rest(T: Array, n: int, rng: np.random.Generator) -> Array:
    """n frames of a part that rests, each off by 0.02 mm and 0.01 deg per axis."""
    return T @ pose.exp(rng.standard_normal((n, 6)) * np.repeat([2e-5, 1.7e-4], 3))


def adjusted(mm: float, first: int, last: int) -> PoseTrack:
    """A part that rests for some frames, and for some more where it was pushed to along x and y."""
    rng = np.random.default_rng(0)
    after = BEFORE @ pose.at((mm * 1e-3, mm * 1e-3, 0.0))
    T = np.concatenate([at_rest(BEFORE, first, rng), at_rest(after, last, rng)])
    return PoseTrack(np.arange(len(T)) / RATE_HZ, T)


@pytest.mark.parametrize(("frames", "rests"), [(5, 1), (20, 2)])
def test_a_few_frames_beside_a_rest_are_no_rest(frames: int, rests: int) -> None:
    """Pushed by 0.55 mm along two axes, which no single frame shows."""
    spans = find_rests(adjusted(0.55, 120, frames))
    assert len(spans) == rests
    assert all(rest.ends - rest.begins >= LEAST_REST_S / 2 for rest in spans)


def test_an_adjusted_part_stays_and_is_where_it_was_last() -> None:
    track = adjusted(2.0, 60, 60)
    intervals = find_intervals("peg", find_rests(track))
    assert [len(each.rests) for each in intervals] == [2]
    for t, frame in ((-1.0, 0), (1.0, 0), (3.0, -1), (9.0, -1)):
        off = pose.log(pose.inverse(find_rest_poses({"peg": intervals}, t)["peg"]) @ track.T[frame])
        assert np.abs(off[:3]).max() < 1e-4
