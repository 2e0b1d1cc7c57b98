"""Pose errors by the definitions of the BOP benchmark, on errors whose size is known by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from apo_bench.benchmark.scoring.pose_errors import (
    EvaluatedModel,
    PoseRecall,
    compute_errors,
    count_matches,
    measure_recall,
)
from apo_bench.formats.bop import EstimatedPose, read_results, write_results
from apo_bench.formats.bop_images import read_image_description
from apo_bench.geometry import Array, pose
from tests.image_sets import SMALL, list_truth, make, write_truth

K = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
CUBE = np.array([(x, y, z) for x in (-10.0, 10.0) for y in (-10.0, 10.0) for z in (-10.0, 10.0)])
SHIFT = st.floats(-20.0, 20.0)


def model(*symmetries: Array) -> EvaluatedModel:
    return EvaluatedModel(CUBE, CUBE, 40.0, np.array([np.eye(4), *symmetries]))


def errors_of(estimate: Array, each: EvaluatedModel) -> Array:
    true = pose.at((0.0, 0.0, 500.0))
    return compute_errors(true[None], estimate[None], each, K)[0, 0]


@given(SHIFT, SHIFT)
def test_a_shift_across_the_camera(x: float, y: float) -> None:
    """Every vertex moves by the shift; the nearest ones, 490 mm away, move most in the image."""
    size = float(np.hypot(x, y))
    mssd, mspd, add = errors_of(pose.at((x, y, 500.0)), model())
    assert mssd == pytest.approx(size / 40.0, abs=1e-9)
    assert add == pytest.approx(size / 40.0, abs=1e-9)
    assert mspd == pytest.approx(600.0 * size / 490.0, abs=1e-9)


def test_a_symmetric_turn_is_no_error() -> None:
    half = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, 180.0))
    turned = pose.at((0.0, 0.0, 500.0)) @ half
    assert errors_of(turned, model(half)) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    mssd, _, add = errors_of(turned, model())
    assert mssd == add == pytest.approx(20.0 * np.sqrt(2.0) / 40.0)  # every corner moves through the axis


def test_each_instance_is_matched_once_and_the_best_scores_come_first() -> None:
    errors = np.array([[0.01, 0.02], [0.30, 0.03]])
    assert count_matches(errors, 0.05) == 2
    assert count_matches(errors[:, :1], 0.05) == 1
    assert count_matches(np.array([[0.01, 0.02], [0.30, 0.40]]), 0.05) == 1  # both estimates are of the first instance
    assert count_matches(np.zeros((2, 0)), 0.05) == 0


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("recall") / "set", config=replace(SMALL, width=320, height=240))


def recall(images: Path, path: Path) -> PoseRecall:
    found = measure_recall(images, read_image_description(images), read_results(path))
    return found["stick_in_tower"]


def test_recall_of_the_truth_is_one_and_of_nothing_zero(images: Path) -> None:
    targets = sum(each["inst_count"] for each in json.loads((images / "test_targets_bop19.json").read_text()))
    assert recall(images, write_truth(images)) == pytest.approx((targets, 1.0, 1.0, 1.0, 1.0))
    write_results(images / "one.csv", [EstimatedPose((1, 3, 99), 1.0, pose.at((0.0, 0.0, 0.9)), -1.0)])
    assert recall(images, images / "one.csv") == (targets, 0.0, 0.0, 0.0, 0.0)


def test_recall_of_shifted_poses_counts_thresholds(images: Path) -> None:
    """12 mm along the ray: of diameters of 93.8 mm (castles) 8 of 10 thresholds hold, of 221.7 mm (stick) 9."""
    visible = [each["obj_id"] for each in json.loads((images / "test_targets_bop19.json").read_text())]
    path = write_truth(images, "far.csv", lambda where, T: pose.at((0.0, 0.0, 0.012)) @ T)
    expected = np.mean([0.9 if number == 3 else 0.8 for number in visible])
    found = recall(images, path)
    assert found.mssd == pytest.approx(expected)
    # As many tolerances of VSD hold. Some thresholds do not, of up to 10 % of the pixels, as the silhouettes move.
    assert expected - 0.2 <= found.vsd <= expected


def test_pixels_count_relative_to_the_width_of_the_image(images: Path) -> None:
    """At a width of 320 a threshold of 5 pixels is one of 2.5: a shift of 4 pixels passes 9 of 10."""
    camera = json.loads((images / "camera.json").read_text())

    def shift(where: tuple[int, int, int], T: Array) -> Array:
        # All vertices of a part lie within 12 cm of its middle, some 0.9 m away, so the shift differs by 15 % at most.
        return pose.at((4.0 * T[2, 3] / camera["fx"], 0.0, 0.0)) @ T

    assert recall(images, write_truth(images, "aside.csv", shift)).mspd == pytest.approx(0.9)


def test_secret_poses_have_no_recall(images: Path) -> None:
    description = replace(read_image_description(images), secret_seed="0" * 16)
    assert measure_recall(images, description, read_results(write_truth(images))) == {}
    assert list(list_truth(images))
