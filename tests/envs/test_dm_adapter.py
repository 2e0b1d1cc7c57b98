"""The environment through `dm_env`: the tests of that interface, the trials of Gymnasium, and dm_control's wrappers."""

import os
import subprocess
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


def inserted() -> gymnasium.Env[Any, Any]:
    return gymnasium.make("APOInsert-v0", scenario="block_on_block", layouts=1, grasp="weld")


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


@needs_dm_control
def test_the_viewer_of_dm_control_finds_an_action_of_its_own() -> None:
    from dm_control.viewer import runtime

    env = to_dm_env(short(), seed=2)
    action = runtime._get_default_action(env.action_spec())
    env.action_spec().validate(action)
    assert not action.any(), "the middle of the bounds: as seen"


@needs_dm_control
def test_the_viewer_of_dm_control_runs_an_episode_which_ends_as_without_it() -> None:
    """Physics is shown at 20 Hz, brought up to date by each step, and what is done to it changes nothing."""
    from dm_control.viewer import runtime

    alone = to_dm_env(inserted(), seed=2)
    step = alone.reset()
    while not step.last():
        step = alone.step(np.zeros(7, dtype=np.float32))
    env = to_dm_env(inserted(), seed=2)
    before = env.physics.data.qpos.copy()
    times = []

    def policy(step: Any) -> Any:
        shown = env.physics.data
        np.testing.assert_array_equal(shown.qpos, env._env.unwrapped.mujoco_data().qpos)
        times.append(shown.time)
        shown.qpos[:] = before
        env.physics.model.opt.gravity[:] = 0.0
        return np.zeros(7, dtype=np.float32)

    run = runtime.Runtime(env, policy)
    run.tick(0.0, paused=False)
    while run.state == runtime.State.RUNNING:
        run.tick(0.05, paused=False)
    assert len(times) > 2
    np.testing.assert_allclose(np.diff(times), 0.05)
    assert env.info == alone.info
    np.testing.assert_array_equal(env._env.unwrapped.mujoco_data().qpos, alone._env.unwrapped.mujoco_data().qpos)


@needs_dm_control
def test_physics_of_a_replay_are_the_parts_before_and_after_it() -> None:
    env = to_dm_env(short(), seed=2)
    env.reset()
    part = env._env.unwrapped.assembly.operations[0].main
    before = env.physics.named.data.xpos[f"{part}/"].copy()
    env.step(np.zeros(env.action_spec().shape))
    moved = env.physics.named.data.xpos[f"{part}/"] - before
    assert env.info["is_success"]
    assert np.linalg.norm(moved) > 0.05


@needs_dm_control
def test_noise_of_actions_by_dm_control_is_the_same_for_a_seed() -> None:
    from dm_control.suite.wrappers import action_noise

    lasts = []
    for seed in (2, 2, 3):
        env = action_noise.Wrapper(to_dm_env(inserted(), seed=seed), scale=0.1)
        env.reset()
        lasts.append(env.step(np.zeros(7, dtype=np.float32)).observation["plan"][-7:])
    np.testing.assert_array_equal(lasts[0], lasts[1])
    assert (lasts[0] != lasts[2]).all()
    assert 0.0 < np.abs(lasts[0]).max() <= 1.0


MATCHED = """
from unittest import mock
import gymnasium, numpy as np
from apo_bench.envs import to_dm_env
from dm_control.suite.wrappers import mujoco_profiling, pixels
from dm_control.viewer import application
def made():
    return to_dm_env(gymnasium.make("APOInsert-v0", scenario="block_on_block", layouts=1, grasp="weld"), seed=2)
env = pixels.Wrapper(made(), pixels_only=False, render_kwargs={"height": 120, "width": 160})
first = step = env.reset()
while not step.last():
    step = env.step(np.zeros(7, dtype=np.float32))
moved = np.abs(step.observation["pixels"].astype(int) - first.observation["pixels"])
print(moved.shape, moved.max() > 50, sorted(step.observation))
with mock.patch.object(application, "gui") as gui:  # all of the viewer but its window, which needs a display
    pictures = []
    gui.RenderWindow.return_value.shape = (160, 120)
    gui.RenderWindow.return_value.event_loop = lambda tick_func: pictures.extend(tick_func() for _ in range(3))
    application.Application().launch(made)
print(len(pictures), pictures[-1].shape, pictures[-1].std() > 10)
env = mujoco_profiling.Wrapper(made())
env.reset()
print(env.step(np.zeros(7, dtype=np.float32)).observation["step_timing"][1])
"""


@needs_dm_control
def test_viewer_and_wrappers_of_dm_control_that_draw_and_measure() -> None:
    """In a process without a display; 50 steps of physics are one of the environment."""
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM")}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", MATCHED],
        env={**kept, "MUJOCO_GL": "egl"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    if "libEGL" in done.stderr or "'NoneType' object has no attribute 'egl" in done.stderr:
        pytest.skip("no EGL")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "(120, 160, 3) True ['agent_pos', 'pixels', 'plan', 'wrench']",
        "3 (120, 160, 3) True",
        "50.0",
    ]


def test_without_dm_control_physics_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """All else works."""
    for name in [name for name in sys.modules if name.split(".")[0] == "dm_control"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "dm_control", None)
    env = to_dm_env(short(), seed=2)
    with pytest.raises(apo_bench.InputError, match=r"pip install dm-control \(Python 3\.11 or 3\.12\)"):
        _ = env.physics
    env.reset()
    assert env.step(np.zeros(env.action_spec().shape)).reward == 1.0


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


def test_spaces_that_are_not_known_are_named() -> None:
    env = _Endless()
    env.action_space = spaces.Text(3)
    with pytest.raises(TypeError, match=r"action: Text was given; Dict, Box and MultiBinary are known\."):
        to_dm_env(env).action_spec()


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
