"""The environment through `dm_env`: the tests of that interface, the trials of Gymnasium, and dm_control's wrappers."""

import sys
import unittest
import unittest.mock
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import apo_bench
from apo_bench.envs import to_dm_env

dm_env = pytest.importorskip("dm_env", reason="dm-env, of the extra dm, is not installed")
from dm_env import specs, test_utils  # noqa: E402

needs_dm_control = pytest.mark.skipif(
    find_spec("dm_control") is None, reason="dm-control is not installed (it installs with Python 3.11 and 3.12)"
)


@pytest.fixture(autouse=True)
def nothing_to_draw_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """dm_control takes hold of a graphics driver when it is imported, its viewer by PyOpenGL; later tests of this
    process draw by EGL."""
    monkeypatch.setenv("MUJOCO_GL", "disable")
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")


def short() -> gymnasium.Env[Any, Any]:
    return gymnasium.make(
        "APOReplay-v0", scenario="block_on_block", noise_level=0.0, human_error_scale=0.0, grasp="weld"
    )


class TestInterface(test_utils.EnvironmentTestMixin, unittest.TestCase):
    """Those of dm_env itself."""

    def make_object_under_test(self) -> Any:
        return to_dm_env(short(), seed=3)

    def make_action_sequence(self) -> Any:
        for _ in range(3):
            yield np.zeros(self.environment.action_spec().shape)


def test_a_seed_is_the_same_trial_as_in_gymnasium() -> None:
    env = short()
    observation, _ = env.reset(seed=5)
    first = to_dm_env(short(), seed=5).reset()
    assert first.first()
    assert {key: value.tobytes() for key, value in first.observation.items()} == {
        key: np.asarray(value).tobytes() for key, value in observation.items()
    }


def test_one_step_is_one_replay_and_the_next_one_resets() -> None:
    env = to_dm_env(short(), seed=1)
    env.reset()
    last = env.step(np.zeros(env.action_spec().shape))
    assert (last.last(), last.reward, last.discount) == (True, 1.0, 0.0)
    assert env.info["is_success"] is True
    again = env.step(np.zeros(env.action_spec().shape))
    assert (again.first(), again.reward) == (True, None)
    env.close()


def test_specs_are_the_spaces() -> None:
    env = short()
    adapted = to_dm_env(env)
    seen = adapted.observation_spec()
    assert set(seen) == set(env.observation_space)
    for name, spec in seen.items():
        assert isinstance(spec, specs.BoundedArray)
        assert spec.shape == env.observation_space[name].shape
    np.testing.assert_array_equal(adapted.action_spec().maximum, env.action_space.high)


@needs_dm_control
def test_the_loop_of_dm_control_drives_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop and the random agent with which dm_control tries the environments of its own suite."""
    monkeypatch.setitem(sys.modules, "mock", unittest.mock)  # which it asks for by the name of before Python 3.3
    from dm_control.suite import suite_test as suite

    env = to_dm_env(short(), seed=2)
    policy = suite.uniform_random_policy(env.action_spec(), random=0)
    seen = list(suite.step_environment(env, policy, num_episodes=2, max_steps_per_episode=3))
    assert [(step.first(), step.last()) for step in seen] == 2 * [(True, False), (False, True)]
    for step in seen:
        for name, spec in env.observation_spec().items():
            spec.validate(step.observation[name])
        env.reward_spec().validate(step.reward or 0.0)
        env.discount_spec().validate(1.0 if step.discount is None else step.discount)


def test_an_environment_without_a_simulation_has_no_physics() -> None:
    with pytest.raises(apo_bench.InputError, match=r"physics was asked of _Endless.*use APOReplay-v0, APOInsert-v0"):
        _ = to_dm_env(_Endless()).physics


def test_truncation_is_no_failure() -> None:
    """An episode that is cut off keeps its discount, so that a learner does not take it for an end."""
    env = to_dm_env(gymnasium.wrappers.TimeLimit(_Endless(), max_episode_steps=2))
    env.reset()
    assert env.step(np.zeros(1)).mid()
    last = env.step(np.zeros(1))
    assert (last.last(), last.discount) == (True, 1.0)


def test_without_dm_env_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dm_env", None)
    monkeypatch.delitem(sys.modules, "apo_bench.envs.dm_adapter", raising=False)
    with pytest.raises(apo_bench.InputError, match="pip install dm-env"):
        to_dm_env(_Endless())


class _Endless(gymnasium.Env[Any, Any]):
    observation_space = spaces.Box(-1.0, 1.0, (1,))
    action_space = spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action: Any) -> Any:
        return np.zeros(1, dtype=np.float32), 0.0, False, False, {}
