"""The camera is where parts on known places say, and contacts are as far open as parts are apart."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import load_scenario
from apo_bench.geometry import Array, pose
from apo_bench.importers.recording.averaging import Mean
from apo_bench.importers.recording.camera_pose import CameraPose, solve_camera
from apo_bench.importers.recording.contact_fit import contact_fit
from apo_bench.scenario.layout import place_layout
from tests.recorded import CAMERA

KNOWN = {"a": pose.at((0.1, 0.0, 0.02), (0.0, 0.0, 30.0)), "b": pose.at((-0.1, 0.2, 0.05), (90.0, 0.0, 0.0))}
SIZE = np.diag(np.repeat([1e-3, np.radians(1.0)], 3) ** 2)


def solved(off: Array) -> CameraPose:
    """The camera, if part b is seen beside its place by a body twist."""
    seen = {part: pose.inverse(CAMERA) @ T for part, T in KNOWN.items()}
    seen["b"] = seen["b"] @ pose.exp(off)
    means = {part: Mean(T, SIZE, np.ones(20, dtype=np.bool_), 20.0) for part, T in seen.items()}
    return solve_camera(KNOWN, means, 0.0 * SIZE)


def test_parts_on_their_places_give_the_camera() -> None:
    camera = solved(np.zeros(6))
    assert np.abs(pose.log(pose.inverse(CAMERA) @ camera.T_world_camera)).max() < 1e-9
    assert camera.off_mm < 1e-6


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


@pytest.mark.parametrize(("up_mm", "tilt_deg"), [(0.0, 0.0), (2.0, 0.0), (0.0, 3.0), (2.0, 3.0)])
def test_a_contact_is_wrong_by_its_gap_in_mm_and_its_angle_in_degrees(up_mm: float, tilt_deg: float) -> None:
    scenario = load_scenario("block_on_block")
    layout = place_layout(scenario, 0.1, 0.0, 0.3)
    bottom = pose.at((0.0, 0.0, up_mm * 1e-3)) @ layout.poses[0]
    half = pose.at((0.0, 0.0, scenario.assembly.solids["A"].bounds[0, 2]))
    tilted = bottom @ half @ pose.at((0.0, 0.0, 0.0), (tilt_deg, 0.0, 0.0)) @ pose.inverse(half)
    fit = contact_fit(scenario.assembly, 0, {**layout.start, scenario.assembly.operations[0].main: tilted})
    assert fit.wrong_mm == pytest.approx(up_mm + tilt_deg, abs=0.02)
