"""A robot that feels: what its row says, and what enters its chance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from apo_bench import Scene, TrialSettings, build_scene, load_scenario, run_trial
from apo_bench.records import Row, Salt, look_up
from apo_bench.records.run.validation import unwritable
from apo_bench.trial.stages import IN_HAND, WRENCH, stream, stream_key

FELT = ("touches", "touches_refused", "felt_mm", "felt_deg", "felt_sure_mm", "felt_sure_deg")


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


def row(scene: Scene, **more: Any) -> Row:
    asked = {"method": "oracle+feel", "careless": 0.0, "fidelity": "contact", "robot_error": "hand_eye:0.5/0.1"} | more
    return run_trial(TrialSettings("block_on_block", seed=3, **asked), scene)


def test_a_row_says_what_was_felt_and_with_what(scene: Scene) -> None:
    found = row(scene, wrench="ideal", stated_error="hand_eye:1/0.2")
    assert (found["wrench"], found["stated_error"]) == ("ideal", "hand_eye:1/0.2")
    assert found["touches"]
    for column in FELT[2:]:
        assert look_up(found, column) > 0.0
    assert unwritable(found) == ""


def test_a_robot_that_does_not_feel_says_nothing(scene: Scene) -> None:
    found = row(scene, method="oracle+search")
    assert [look_up(found, column) for column in FELT] == [None] * len(FELT)
    again = row(scene, method="oracle+search", wrench="cobot", stated_error="unstated")
    given = ("spec_hash", "wrench", "stated_error")
    same = [column for column in found if column not in given]
    assert [look_up(again, column) for column in same] == [look_up(found, column) for column in same]


def test_the_noise_of_the_sensor_has_a_stream_of_its_own() -> None:
    assert WRENCH == IN_HAND + 1
    salt = Salt(b"0" * 32)
    for given in (None, salt):
        key = stream_key(3, WRENCH, given)
        assert np.random.default_rng(key).random() == stream(3, WRENCH, given).random()
    assert stream_key(3, WRENCH) == (3, WRENCH)
    assert stream_key(3, WRENCH, salt)[:2] == (3, WRENCH)
    assert len(stream_key(3, WRENCH, salt)) > 2
