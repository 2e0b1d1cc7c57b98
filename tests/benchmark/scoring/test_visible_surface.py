"""Visible surface discrepancy of flat surfaces, whose pixels can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from apo_bench.benchmark.scoring.visible_surface import TOLERANCES, DepthView, compute_discrepancies, compute_vsd
from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.scenario import load_scenario
from apo_bench.simulation.sensor.rays import ModelRays

DIAMETER_M = 0.1


def square(left: int, distance_m: float = 1.0) -> Array:
    """A surface that covers 10 x 10 pixels from a column on."""
    image = np.full((10, 40), np.inf)
    image[:, left : left + 10] = distance_m
    return image


@given(st.integers(0, 10))
def test_a_shift_across_the_camera_costs_what_does_not_overlap(shift: int) -> None:
    found = compute_vsd(np.full((10, 40), np.nan), square(10), square(10 + shift), DIAMETER_M)
    assert found == pytest.approx(np.full(10, 2 * shift / (10 + shift)))


@given(st.floats(-0.06, 0.06))
def test_a_shift_along_the_camera_costs_all_below_its_tolerance(shift_m: float) -> None:
    found = compute_vsd(np.full((10, 40), np.nan), square(10), square(10, 1.0 + shift_m), DIAMETER_M)
    assert np.array_equal(found, (abs((1.0 + shift_m) - 1.0) / DIAMETER_M >= TOLERANCES).astype(float))


def test_what_is_hidden_does_not_count() -> None:
    """The right half of the true square is behind another surface, farther than the 15 mm of the definition."""
    measured = np.minimum(square(10), square(15, 0.98))
    assert not compute_vsd(measured, square(10), square(10), DIAMETER_M).any()
    assert compute_vsd(measured, square(10), square(15), DIAMETER_M) == pytest.approx(1.0)
    near = np.minimum(square(10), square(15, 0.99))
    assert compute_vsd(near, square(10), square(15), DIAMETER_M) == pytest.approx(np.full(10, 10 / 15))
    assert compute_vsd(square(0, 0.5), np.full((10, 40), np.inf), np.full((10, 40), np.inf), DIAMETER_M).all()


def test_models_are_cast_at_their_poses_in_the_frame_of_the_camera() -> None:
    """A block that is estimated 8 mm too far: 8 mm of discrepancy, and a silhouette that is a little smaller."""
    solid = load_scenario("block_on_block").assembly.solids["A"]
    view = PinholeView(pose.at((0.3, 0.2, 0.1), (30.0, 20.0, 10.0)), 160, 120, 30.0)
    cast = ModelRays({"7": solid}, 0.0)
    true = pose.at((0.0, 0.0, 0.5), (10.0, 20.0, 30.0))[None]
    far = pose.at((0.0, 0.0, 0.008)) @ true
    image = DepthView(np.full((120, 160), np.nan), view, cast)
    measured = DepthView(np.where(np.isfinite(alone := image.cast_model(7, true[0])), alone, np.nan), view, cast)
    assert np.isfinite(alone).sum() > 500
    same, away = (compute_discrepancies(measured, 7, true, T, DIAMETER_M)[0, 0] for T in (true, far))
    assert not same.any()
    assert away[0] == 1.0
    assert (away[2:] < 0.15).all()
