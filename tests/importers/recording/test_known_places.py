"""The camera is where parts on known places say, and contacts are as far open as parts are apart."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.averaging import Mean
from apo_bench.importers.recording.camera_pose import CameraPose, solve_cameras
from tests.recorded import CAMERA

KNOWN = {"a": pose.at((0.1, 0.0, 0.02), (0.0, 0.0, 30.0)), "b": pose.at((-0.1, 0.2, 0.05), (90.0, 0.0, 0.0))}
SIZE = np.diag(np.repeat([1e-3, np.radians(1.0)], 3) ** 2)


def solved(off: Array) -> CameraPose:
    """The camera, if part b is seen beside its place by a body twist."""
    seen = {part: pose.inverse(CAMERA) @ T for part, T in KNOWN.items()}
    seen["b"] = seen["b"] @ pose.exp(off)
    means = {part: Mean(T, SIZE, np.ones(20, dtype=np.bool_), 20.0) for part, T in seen.items()}
    return solve_cameras(KNOWN, means, 0.0 * SIZE)[0]


def test_places_that_disagree_make_the_camera_unsure() -> None:
    """The covariance grows by chi-square over its degrees of freedom, 12 - 6."""
    off = np.array([0.0, 0.0, 0.01, 0.0, 0.0, 0.0])
    sure = solved(np.zeros(6)).covariance
    unsure = solved(off)
    assert sure is not None
    assert unsure.covariance is not None
    ratio = np.diag(unsure.covariance) / np.diag(sure)
    # 10 mm between two parts whose means are each known to 0.3 mm: chi-square is 0.5 (10 / 0.3)^2 and less for the tilt
    assert ((ratio > 40.0) & (ratio < 90.0)).all()
    assert 1.0 < unsure.off_mm < 10.0
    assert set(unsure.residuals) == {"a", "b"}
