"""Tracking as a decision process: what is shown, what is possible, and the correctors that are policies of it."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from apo_bench import correct, observe
from apo_bench.assembly import Step
from apo_bench.envs.apo_track import DO, FINISH, UNDO, APOTrack, follow
from apo_bench.envs.tracking import contact_policy, observe_first, paper_track_policy
from apo_bench.geometry import pose
from tests import scenes

NOTHING = np.zeros(6)


@pytest.fixture(scope="module")
def env() -> Iterator[APOTrack]:
    """Without a replay, which APOReplay's tests look after."""
    made = gymnasium.make("APOTrack-v0", replay=False).unwrapped
    assert isinstance(made, APOTrack)
    yield made
    made.close()


def act(env: APOTrack, which: int) -> tuple[Any, ...]:
    return env.step({"act": which, "twist": NOTHING})


@pytest.mark.filterwarnings("ignore")
def test_gymnasium_finds_nothing_to_complain_of(env: APOTrack) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(env, skip_render_check=True)


def test_an_operation_is_shown_when_the_one_before_is_done(env: APOTrack) -> None:
    first, info = env.reset(seed=1)
    assert (first["shown"].tolist(), first["done"].tolist()) == ([1, 0, 0], [0, 0, 0])
    assert info["action_mask"].tolist() == [1, 0, 1]
    np.testing.assert_array_equal(first["poses"][1:], [[0, 0, 0, 1, 0, 0, 0]] * 2)
    assert not first["covariance"][1:].any()
    assert not first["observed"][1:].any()
    assert len(env.tracked.observation.poses) == 1
    second, reward, *over, info = act(env, DO)
    assert (second["shown"].tolist(), second["done"].tolist()) == ([1, 1, 0], [1, 0, 0])
    assert (reward, over, info["action_mask"].tolist()) == (0.0, [False, False], [1, 1, 1])
    np.testing.assert_array_equal(second["placed"], second["poses"])
    back, *_ = act(env, UNDO)
    assert (back["shown"].tolist(), back["done"].tolist()) == ([1, 1, 0], [0, 0, 0])
    assert env.schedule == (Step(0), Step(0, undo=True))
    assert env.observation_space.contains(back)


def test_a_twist_moves_what_is_done_from_where_it_was_seen(env: APOTrack) -> None:
    seen, _ = env.reset(seed=1)
    twist = np.array([1e-3, 0, 0, 0, 0, 0.01])
    for _ in range(2):
        after, *_ = env.step({"act": DO, "twist": twist})
        np.testing.assert_allclose(pose.unpack(after["placed"][0]), pose.unpack(seen["poses"][0]) @ pose.exp(twist))
        env.step({"act": UNDO, "twist": twist})


def test_it_ends_when_it_is_finished_given_up_or_after_too_many_acts(env: APOTrack) -> None:
    env.reset(seed=1)
    *_, reward, terminated, truncated, info = act(env, FINISH)
    assert (reward, terminated, truncated, info["code"], info["operation"]) == (0.0, True, False, "not_made", 1)
    assert info["action_mask"].tolist() == [0, 0, 0]
    with pytest.raises(gymnasium.error.ResetNeeded):
        act(env, DO)
    env.reset(seed=1)
    ends = [act(env, UNDO)[2:4] for _ in range(18)]
    assert ends == [(False, False)] * 17 + [(False, True)]


@pytest.mark.parametrize("name", ["stick_in_tower", "vanished_fixture"])
def test_the_corrector_of_the_paper_is_a_policy(name: str) -> None:
    """What it reaches, and every act of it: `paper-track` that sees one operation after the other."""
    env = APOTrack(name, replay=False)
    for seed in range(2):
        env.reset(seed=seed)
        asked = correct(env._base.observation, "paper-track")
        reward, info = follow(env, paper_track_policy)
        assert (reward, info["code"], asked.status) == (1.0, "ok", "converged")
        assert env.schedule == asked.schedule
        np.testing.assert_allclose(env.placed, asked.poses, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(np.array(env._step_poses), asked.step_poses, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("policy", [paper_track_policy, contact_policy])
def test_policies_give_up_where_correctors_do(policy: Any) -> None:
    def misses(assembly: Any, shown: Any, rng: np.random.Generator) -> Any:
        seen = observe(shown, "isotropic", rng)
        return replace(seen, observed=np.array([True, False]))

    env = APOTrack("dovetail", replay=False, noise=misses)
    env.reset(seed=1)
    reward, info = follow(env, policy)
    assert (reward, info["code"], info["operation"]) == (0.0, "not_made", 2)


def test_the_end_is_replayed_with_everything_that_was_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    env = APOTrack("block_on_block", grasp="weld")
    env.reset(seed=1)
    for which in (DO, UNDO, *[DO] * len(env.placed)):
        act(env, which)
    other = copy.deepcopy(env)
    aimed: list[Any] = []
    aim = env._base.aim
    monkeypatch.setattr(env._base, "aim", lambda *plan: (aimed.append(plan), aim(*plan)))
    *_, reward, _, _, info = act(env, FINISH)
    assert aimed[0][1] == [Step(0), Step(0, undo=True), *map(Step, range(len(env.placed)))]
    assert (reward, info["is_success"], info["code"]) == (1.0, True, "ok")
    assert {"failure_prediction", "predicted_success"} <= info.keys()
    assert act(other, FINISH)[1] == reward


@pytest.mark.parametrize("noise", ["isotropic", "bias-view", "heavy-tailed"])
def test_nothing_is_known_of_what_was_not_seen_yet(noise: str) -> None:
    shown = scenes.shown(scenes.stick_in_tower())
    whole = observe(shown, noise, np.random.default_rng(1))
    part = observe_first(whole, 2)
    assert len(part.assembly) == len(part.poses) == len(part.covariance) == len(part.observed) == 2
    assert {k for error in part.shared for k in error.operations} <= {0, 1}
    assert correct(part, "contact").poses.shape == (2, 4, 4)
    assert correct(observe_first(whole, 3), "contact").poses.tobytes() == correct(whole, "contact").poses.tobytes()
