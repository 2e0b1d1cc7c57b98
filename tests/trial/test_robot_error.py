"""What is wrong with the robot is met by the physics, and by nobody who plans."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.records import TrialRecord
from apo_bench.trial.trial_stages import draw_robot_error

SEED = 3


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


def row(scene: Scene, robot_error: str, **more: Any) -> TrialRecord:
    asked = {
        "method": "uncorrected",
        "noise_mm": 0.5,
        "noise_deg": 0.5,
        "human_error_scale": 0.0,
        "fidelity": "near-contact",
    } | more
    return run_trial(TrialConfig("block_on_block", seed=SEED, robot_error=robot_error, **asked), scene)


def test_errors_are_in_proportion_and_each_has_its_own_chance(scene: Scene) -> None:
    one, two = (draw_robot_error(f"tool:{mm}+joints:0.1+in_hand:1/2", scene, SEED) for mm in (1, 2))
    alone = draw_robot_error("joints:0.1", scene, SEED)
    assert one is not None
    assert two is not None
    assert alone is not None
    np.testing.assert_allclose(two.tool[:3, 3], 2 * one.tool[:3, 3], rtol=1e-12)
    np.testing.assert_array_equal(one.joints, alone.joints)
    np.testing.assert_array_equal(one.in_hand, two.in_hand)
    assert not one.in_hand[:, 0, 3].any(), "a part slips along the pads, not through them"
    np.testing.assert_array_equal(alone.hand_eye, np.eye(4))
    assert not any(map(alone.slips, range(len(scene.scenario.assembly))))
    assert draw_robot_error("none", scene, SEED) is None


def test_a_plan_is_the_same_whatever_is_wrong_with_the_robot_and_ends_elsewhere(scene: Scene) -> None:
    right = row(scene, "none")
    for wrong in ("hand_eye:1/0.2", "tool:1", "joints:0.1", "in_hand:0.5/1", "sag:1", "base_tilt:0.2", "finger:2"):
        found = row(scene, wrong)
        for column in ("failure_prediction", "gap_before_mm", "gap_after_mm", "chi_square", "corrected_operations"):
            assert found.get(column) == right.get(column)
        assert found["final_poses"] != right["final_poses"]
        assert found["robot_error"] == wrong
