"""Policies of APOInsert-v0: the teacher brings the part where it has to go, and knows more than the robot to do so."""

from __future__ import annotations

import numpy as np

from apo_bench import TrialConfig
from apo_bench.envs.policies import expert, insert_env, straight


def test_the_teacher_goes_where_the_part_really_has_to_go() -> None:
    env = insert_env(TrialConfig("stick_in_tower", method="contact-robust", noise_mm=1.0, noise_deg=1.0))
    seen, _ = env.reset(options={"trial": 3})
    for _ in range(2):
        seen, *_ = env.step(np.array([1, 1, -1, 0, 0, 1, -1], dtype=np.float32))
    first = env.off
    for _ in range(5):
        seen, *_ = env.step(np.float32(expert(env, seen)))
    assert np.linalg.norm(first[:2]) > 1e-3
    assert np.linalg.norm(env.off[:2]) < 0.2 * np.linalg.norm(first[:2])
    assert first[2] < env.off[2] < 0.0
    assert straight(env, seen).tolist() == [0.0] * 7


def test_a_robot_that_is_right_by_its_settings_gets_the_usual_error_of_the_environment() -> None:
    wrong = {error: insert_env(TrialConfig("block_on_block", robot_error=error)).spec for error in ("none", "tool:1")}
    assert [spec.kwargs["robot_error"] for spec in wrong.values() if spec] == ["hand_eye:0.5/0.1", "tool:1"]
