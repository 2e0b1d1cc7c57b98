"""The noise of a camera is measured on parts that rest."""

from __future__ import annotations

import numpy as np

from apo_bench.importers.recording.still import still_residuals
from apo_bench.importers.recording.tracks import Log, PoseTrack
from apo_bench.perception.observation.fitting.fit import fit_noise
from tests.recorded import seen


def test_scatter_and_missing_frames_are_those_that_were_made() -> None:
    rng = np.random.default_rng(2)
    tracks = {}
    for part, (t, T) in seen("stick_in_tower", 0.8, seed=5).items():
        kept = rng.random(len(t)) > 0.1
        tracks[part] = PoseTrack(t[kept], T[kept])
    residuals = still_residuals(Log("log", tracks, ()))
    measured = fit_noise(residuals, "still")
    # some 400 frames: a scale is known within 5 %, four of those
    for split in (measured.shift_mm, measured.turn_deg):
        across, along = np.sqrt(split.variances)
        assert abs(across / 0.8 - 1.0) < 0.2
        assert abs(along / 0.8 - 1.0) < 0.2
    assert abs(measured.missed - 0.1) < 0.05
