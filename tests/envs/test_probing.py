"""An environment whose robot feels is the trial of a method with `+probe`."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import TrialConfig
from apo_bench.envs import robot
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.corrected import CorrectPoses
from apo_bench.trial import run

SCENARIO = "block_on_block"


def test_a_robot_that_feels_is_given_what_the_trial_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    given = []

    def noted(*plain):  # type: ignore[no-untyped-def]
        given.append(plain[4])
        raise InterruptedError

    for where in (robot, run):
        monkeypatch.setattr(where, "replay_and_judge", noted)
    settings = {"robot_error": "hand_eye:0.5/0.1", "ft_sensor": "0.5", "assumed_robot_error": "hand_eye:1/0.2+tool:0.3"}
    env = CorrectPoses(APOReplay(SCENARIO, probe=True, **settings))
    env.reset(seed=4)
    with pytest.raises(InterruptedError):
        env.step(np.zeros(env.action_space.shape))
    with pytest.raises(InterruptedError):
        run.run_trial(TrialConfig(SCENARIO, seed=4, method="contact-robust+probe", **settings))
    assert all(config.spiral for config in given)
    ours, theirs = (config.probing for config in given)
    assert (ours.ft_sensor, ours.seed) == (theirs.ft_sensor, theirs.seed)
    assert ours.ft_sensor == "0.5/0.025"
    np.testing.assert_array_equal(ours.slip, theirs.slip)
    for name in ("mean", "sigmas", "middle"):
        np.testing.assert_array_equal(getattr(ours.estimate, name), getattr(theirs.estimate, name))
