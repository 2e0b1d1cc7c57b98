"""Predicted success in the environment, and an environment that abstains."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from apo_bench import TrialConfig, run_trial
from apo_bench.envs import robot
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.corrected import CorrectPoses

SCENARIO = "block_on_block"
SEED = 2


def zeros(env: gymnasium.Env) -> np.ndarray:
    return np.zeros(env.action_space.shape, dtype=env.action_space.dtype)  # type: ignore[type-var]


def test_an_episode_promises_what_its_trial_promises() -> None:
    env = CorrectPoses(APOReplay(SCENARIO, robot_error="tool:0.2"))
    env.reset(seed=SEED)
    *_, info = env.step(zeros(env))
    row = run_trial(TrialConfig(SCENARIO, seed=SEED, robot_error="tool:0.2"))
    assert info["predicted_success"] == row["predicted_success"]


def test_an_environment_that_abstains_gives_no_reward_and_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot, "replay_and_judge", lambda *given, **named: pytest.fail("the arm moved"))
    env = CorrectPoses(APOReplay(SCENARIO, min_predicted_success=1.0))
    env.reset(seed=SEED)
    _, reward, terminated, _, info = env.step(zeros(env))
    assert (reward, terminated, info["stage"], info["code"]) == (0.0, True, "predicted-success", "abstained")
    assert info["predicted_success"] < 1.0
