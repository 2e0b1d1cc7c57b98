"""Tracks of symmetric parts are folded to one image, whichever images a tracker reports."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import load_scenario
from apo_bench.geometry import Solid, pose
from apo_bench.importers.recording.folding import fold_track, list_images, measure_distances
from apo_bench.importers.recording.tracks import PoseTrack

SOLIDS = {
    "stick": load_scenario("stick_in_tower").assembly.solids["stick"],
    "peg": load_scenario("peg_in_hole").assembly.solids["peg"],
}


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_reported_images_do_not_matter(solid: Solid, seed: int) -> None:
    """A part turns by 3 degrees a frame about any axis; the folded track is smooth, and at images of the true poses."""
    rng = np.random.default_rng(seed)
    step = np.concatenate([[0.0, 0.0, 0.002], np.radians(3.0) * _direction(rng)])
    T = pose.at((0.1, 0.2, 0.9)) @ pose.exp(np.arange(40)[:, None] * step)
    images = list_images(solid, np.eye(4), 24)
    reported = PoseTrack(np.arange(40) / 30.0, T @ images[rng.integers(0, len(images), 40)])
    folded = fold_track(reported, solid).track
    assert measure_distances(solid, folded.T, T).max() < 1e-6
    turns = pose.log(pose.inverse(folded.T[:-1]) @ folded.T[1:])[:, 3:]
    assert np.degrees(np.linalg.norm(turns, axis=1)).max() < 3.1  # of a part of revolution only the tilt is left


def _direction(rng: np.random.Generator) -> np.ndarray:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))
