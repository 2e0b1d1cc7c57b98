"""A robot that feels: what its row says, and what enters its chance."""

from __future__ import annotations

from typing import Any

import pytest

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.records import TrialRecord
from apo_bench.records.run.validation import describe_unwritable

FELT = (
    "probe_contacts",
    "probe_contacts_rejected",
    "base_error_estimate_mm",
    "base_error_estimate_deg",
    "base_error_estimate_std_mm",
    "base_error_estimate_std_deg",
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


def row(scene: Scene, **more: Any) -> TrialRecord:
    asked = {
        "method": "oracle+probe",
        "human_error_scale": 0.0,
        "fidelity": "near-contact",
        "robot_error": "hand_eye:0.5/0.1",
    } | more
    return run_trial(TrialConfig("block_on_block", seed=3, **asked), scene)


def test_a_row_says_what_was_felt_and_with_what(scene: Scene) -> None:
    found = row(scene, ft_sensor="ideal", assumed_robot_error="hand_eye:1/0.2")
    assert (found["ft_sensor"], found["assumed_robot_error"]) == ("ideal", "hand_eye:1/0.2")
    assert found["probe_contacts"]
    for column in FELT[2:]:
        assert dict(found)[column] > 0.0
    assert describe_unwritable(found) == ""


def test_a_robot_that_does_not_feel_says_nothing(scene: Scene) -> None:
    found = row(scene, method="oracle+spiral")
    assert [found.get(column) for column in FELT] == [None] * len(FELT)
    again = row(scene, method="oracle+spiral", ft_sensor="joint-torque", assumed_robot_error="unknown")
    given = ("config_hash", "ft_sensor", "assumed_robot_error")
    same = [column for column in found if column not in given]
    assert [again.get(column) for column in same] == [found.get(column) for column in same]
