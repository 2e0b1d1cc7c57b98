"""One integer is one trial, bit for bit: after a replay, and in a new scene."""

from __future__ import annotations

import pytest

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.trial.trial_stages import simulate_demonstration


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("stick_on_castles"), grasp="weld")


def test_a_trial_is_the_same_after_a_replay_and_in_a_new_scene(scene: Scene) -> None:
    spec = TrialConfig("stick_on_castles", grasp="weld", method="paper", seed=3)
    shown = simulate_demonstration(scene, 1.0, 3)
    first = run_trial(spec, scene, simulated=shown)
    assert first["sim_time_s"] > 1.0
    assert run_trial(spec, scene, simulated=shown) == first
    assert run_trial(spec, build_scene(load_scenario("stick_on_castles"), grasp="weld")) == first
