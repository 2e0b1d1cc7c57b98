"""Copies of an environment, and the settings of one episode."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest

import apo_bench
from apo_bench import Correction, InputError, Observation
from apo_bench.envs import episode
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.spaces import observation_entries
from apo_bench.perception.observation.noise import NoiseLevel, make_noise

SEED = 5
WAYS: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "deepcopy": copy.deepcopy,
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
}
SMALL = "block_on_block"
NEAR = np.full((2, 6), 1e-4)


@pytest.fixture(scope="module")
def env() -> APOReplay:
    """One between reset and step; nothing here may change it."""
    made = APOReplay(grasp="weld")
    made.reset(seed=SEED)
    return made


def same(a: Any, b: Any) -> bool:
    """Whether two results, nested, are equal bit by bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return np.array_equal(a, b)


@pytest.mark.parametrize(("way", "noise_level"), [("pickle", 0.5), ("cloudpickle", 40.0)])
def test_a_copy_goes_on_as_the_original_would(way: str, noise_level: float) -> None:
    """Before the first reset, between reset and step, and after the step; at level 40 the arm does not move."""
    made = gymnasium.make(
        "APOReplay-v0", scenario=SMALL, noise_level=noise_level, grasp="weld", render_mode="rgb_array"
    )
    env = apo_bench.CorrectPoses(made, "paper")
    fresh = WAYS[way](env)
    begun = env.reset(seed=SEED)
    assert same(fresh.reset(seed=SEED), begun)
    pending = WAYS[way](env)
    stepped = env.step(NEAR)
    assert same(pending.step(NEAR), stepped)
    over = WAYS[way](env)
    assert same(over.render(), env.render())
    with pytest.raises(gymnasium.error.ResetNeeded):
        over.step(NEAR)
    following = env.reset()
    assert same(pending.reset(), following)
    assert same(over.reset(), following)
    assert env.unwrapped.trial == pending.unwrapped.trial == over.unwrapped.trial != SEED


def test_a_copy_is_one_of_its_own(env: APOReplay) -> None:
    kept = env.observation.poses.copy()
    other = copy.deepcopy(env)
    other.reset(seed=SEED + 1, options={"noise_level": 3.0, "clearance_mm": 0.5})
    assert (env.trial, other.trial) == (SEED, SEED + 1)
    assert env._scene.clearance_mm != other._scene.clearance_mm
    np.testing.assert_array_equal(env.observation.poses, kept)


def test_what_is_frozen_is_frozen_in_the_copy(env: APOReplay) -> None:
    copied = WAYS["pickle"](env)
    seen: Observation = copied.observation
    assert seen.assembly is copied.assembly
    face = next(iter(copied.assembly.solids["stick"].faces.values()))
    for array in (seen.poses, seen.covariance, seen.observed, *seen.start.values(), face.outline, face.normal):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    for mapping in (seen.start, copied.assembly.solids, copied._scene.scenario.colors):
        with pytest.raises(TypeError, match="does not support item assignment"):
            mapping["stick"] = None


def test_a_correction_can_be_pickled() -> None:
    made = Correction(np.tile(np.eye(4), (2, 1, 1)), "converged", "", (1,), 0.1, 0.0, 3)
    again = pickle.loads(pickle.dumps(made))
    assert (again.status, again.freed, again.covariance) == ("converged", (1,), None)
    np.testing.assert_array_equal(again.poses, made.poses)


@pytest.mark.parametrize("name", ["camera", "swaps", "megapose-lmo"])
def test_every_noise_model_travels(env: APOReplay, name: str) -> None:
    assert env._episode is not None
    noise = make_noise(name, NoiseLevel(1.0, 1.0))
    here, there = (
        model(env.assembly, env._episode.simulated.demonstration, np.random.default_rng(1))
        for model in (noise, pickle.loads(pickle.dumps(noise)))
    )
    np.testing.assert_array_equal(here.poses, there.poses)


def test_a_copy_of_what_a_range_finder_sees_is_small_and_rays_have_a_level() -> None:
    """The depth images of the demonstration, tens of megabytes, are gone when the poses are measured."""
    env = APOReplay(SMALL, pose_source="depth-camera", noise_level=1.0)
    usual = env.reset(seed=SEED)
    pickled = pickle.dumps(env)
    assert len(pickled) < 2e6
    worse = pickle.loads(pickled).reset(seed=SEED, options={"noise_level": 3})
    assert same(worse, APOReplay(SMALL, pose_source="depth-camera", noise_level=3).reset(seed=SEED))
    assert not same(worse, usual)
    with pytest.raises(InputError, match="noise level must be"):
        env.reset(options={"noise_level": (1, 1)})


def test_a_window_is_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    class Window:
        def __init__(self, scene: Any) -> None: ...

        def __call__(self, data: Any) -> None: ...

        def close(self) -> None: ...

        def __reduce__(self) -> Any:
            raise TypeError("a window cannot be pickled")

    monkeypatch.setattr("apo_bench.simulation.scene.render.ReplayWindow", Window)
    env = APOReplay(SMALL, grasp="weld", noise_level=40, render_mode="human")
    env.reset(seed=SEED)
    env.step(NEAR)
    assert env._rendering.window is not None
    assert WAYS["deepcopy"](env)._rendering.window is None


@pytest.mark.parametrize("options", [{"noise_level": (0.5, 0.25), "human_error_scale": 0}, {"clearance_mm": 0.5}])
def test_options_are_of_one_episode(env: APOReplay, options: dict[str, Any]) -> None:
    """It is that of an environment which was made with them, and the next one is as ever."""
    other = copy.deepcopy(env)
    usual = observation_entries(env.observation), {"demonstration": "ok"}
    got = other.reset(seed=SEED, options=options)
    assert same(got, APOReplay(grasp="weld", **options).reset(seed=SEED))
    assert not same(got, usual)
    assert same(other.reset(seed=SEED), usual)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"levl": 1}, "unknown option of reset.. 'levl'; did you mean 'noise_level'. Known: clearance_mm, human"),
        ([("noise_level", 1)], "a dict with trial, noise_level, human_error_scale, clearance_mm is"),
        ({"noise_level": None}, "noise level must be"),
        ({"noise_level": 2, "human_error_scale": 11}, "human error scale must be a number from 0 to 10, got 11"),
        ({"noise_level": 2, "clearance_mm": 5.1}, "clearance mm must be a number from 0 to 5, got 5.1"),
    ],
)
def test_wrong_options_are_refused_and_change_nothing(env: APOReplay, options: Any, words: str) -> None:
    other = copy.deepcopy(env)
    with pytest.raises(InputError, match=words):
        other.reset(seed=1, options=options)
    assert other.trial == SEED
    assert other._scene.clearance_mm == env._scene.clearance_mm
    assert other._now == env._now
    assert other.np_random.bit_generator.state == env.np_random.bit_generator.state


def test_scenes_of_other_clearances_are_kept_but_not_for_ever(env: APOReplay, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[float] = []
    scene = env._scene
    monkeypatch.setattr(episode, "build_scene", lambda _, clearance_mm, **__: built.append(clearance_mm) or object())
    scenes = episode.Scenes(scene)
    for clearance in (0.5, 0.6, 0.5, None, 0.25):
        scenes.of(clearance)
    assert built == [0.5, 0.6]
    assert scenes.of(None) is scenes.of(0.25) is scene
    for i in range(episode.MOST_SCENES):
        scenes.of(1.0 + i)
    scenes.of(0.5)
    assert built.count(0.5) == 2
    assert len(scenes._others) == episode.MOST_SCENES


@pytest.mark.slow
def test_environments_work_in_spawned_processes() -> None:
    many = gymnasium.make_vec("APOReplay-v0", 2, "async", {"context": "spawn"}, scenario=SMALL, grasp="weld")
    env = APOReplay(SMALL, grasp="weld")
    try:
        seen, infos = many.reset(seed=[SEED, SEED + 1], options={"noise_level": 2.0})
        assert "trial" not in infos
        for i in range(2):
            mine, _ = env.reset(seed=SEED + i, options={"noise_level": 2.0})
            np.testing.assert_array_equal(seen["poses"][i], mine["poses"])
        assert many.get_attr("trial") == (SEED, SEED + 1)
    finally:
        many.close()
