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
from apo_bench import InputError
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.envs.spaces import observation_entries

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
