"""APOInsert-v0 as Gymnasium and its users expect it."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest

from apo_bench.assembly import Outcome
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.episode_start import TrialStarts
from apo_bench.errors import InputError
from apo_bench.records import FIRST_TRAINING_TRIAL

TRIAL = {"trial": 3}
STILL = np.zeros(7, dtype=np.float32)


@pytest.fixture(scope="module")
def env() -> Iterator[APOInsert]:
    """The first block on the table: nothing has to be found."""
    made = gymnasium.make("APOInsert-v0", scenario="block_on_block", grasp="weld", layouts=2).unwrapped
    assert isinstance(made, APOInsert)
    yield made
    made.close()


def run(env: Any, *actions: Any) -> list[Any]:
    """What is seen after each action; the last one of them for ever."""
    said = []
    for action in actions:
        said.append(env.step(action))
    return said


def same(a: Any, b: Any) -> bool:
    return all(np.array_equal(a[name], b[name]) for name in a)


def test_the_approach_alone_puts_a_block_where_it_belongs(env: APOInsert) -> None:
    seen, info = env.reset(options=TRIAL)
    assert info == {}
    assert env.observation_space.contains(seen)
    left = [float(seen["plan"][3])]
    over = False
    reward = 0.0
    while not over:
        seen, reward, over, truncated, info = env.step(STILL)
        left.append(float(seen["plan"][3]))
    assert reward == 1.0
    assert info["success"] is info["is_success"] is True
    assert info["code"] == "ok"
    assert not truncated
    assert left[0] > 10.0
    assert abs(left[-1]) < 2.5
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STILL)


def test_where_nothing_is_wrong_the_approach_alone_inserts_a_stick_along_its_line() -> None:
    env = APOInsert(corrector="oracle", robot_error="none")
    seen, _ = env.reset(options=TRIAL)
    aside = []
    over = False
    while not over:
        seen, reward, over, _, _ = env.step(STILL)
        aside.append(seen["agent_pos"][:2])
    assert reward == 1.0
    assert np.abs(aside).max() < 0.3
    assert env.truth.shape == (3, 4, 4)


def test_the_same_seed_gives_the_same_bytes(env: APOInsert) -> None:
    actions = [env.action_space.sample() * 0.2 for _ in range(4)]
    first = [env.reset(seed=11)[0], *(step[0] for step in run(env, *actions))]
    env.reset(seed=4)
    again = [env.reset(seed=11)[0], *(step[0] for step in run(env, *actions))]
    assert all(same(a, b) for a, b in zip(first, again, strict=True))


def test_a_copy_goes_on_as_the_original_would(env: APOInsert) -> None:
    env.reset(seed=2)
    run(env, STILL, STILL)
    copies = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
    there = env.step(STILL)[0]
    assert all(same(other.step(STILL)[0], there) for other in copies)


def test_actions_move_the_tip_in_the_frame_of_the_way_in() -> None:
    env = APOInsert("block_on_block", grasp="weld", residual=False, robot_error="none")
    before, _ = env.reset(options=TRIAL)
    aside = np.array([1, 0, 0, 0, 0, 1, -1], dtype=np.float32)
    after = run(env, *[aside] * 5, *[STILL] * 3)[-1][0]
    moved = after["agent_pos"] - before["agent_pos"]
    np.testing.assert_allclose(moved[:6], [5, 0, 0, 0, 0, 2.5], atol=0.15)
    np.testing.assert_array_equal(after["plan"][12:], STILL)


def test_progress_is_rewarded_by_what_the_robot_itself_knows() -> None:
    env = APOInsert("block_on_block", grasp="weld", reward="progress")
    seen, _ = env.reset(options=TRIAL)
    begins = float(seen["plan"][3])
    over = False
    rewards = []
    while not over:
        seen, reward, over, _, info = env.step(STILL)
        rewards.append(reward)
    share = 1.0 - max(float(seen["plan"][4]), 0.0) / begins
    assert sum(rewards) == pytest.approx(share + info["success"], abs=1e-3)


def test_the_hand_opens_at_the_time_limit_and_the_episode_is_truncated() -> None:
    env = APOInsert("block_on_block", grasp="weld", horizon=2)
    env.reset(options=TRIAL)
    first, second = run(env, STILL, STILL)
    assert first[2:] == (False, False, {"success": False})
    assert second[2:4] == (False, True)
    assert second[4]["code"] != ""


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"operation": 3}, "operation 3"),
        ({"corrector": "oracle+probe"}, "takes a corrector without"),
        ({"starts": "test"}, "unknown kind of starts 'test'"),
    ],
)
def test_wrong_arguments_are_refused_in_one_sentence(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        APOInsert("block_on_block", **wrong)


def test_wrong_calls_are_refused_in_one_sentence(env: APOInsert) -> None:
    env.reset(options=TRIAL)
    with pytest.raises(InputError, match="seven numbers"):
        env.step(np.full(7, 2.0, dtype=np.float32))
    with pytest.raises(InputError, match="option of reset"):
        env.reset(options={"noise": 2})
    with pytest.raises(InputError, match="seven numbers"):
        env.step("forward")  # type: ignore[arg-type]
    for trial in (3.5, "3", True, float("nan"), [1], -1):
        with pytest.raises(InputError, match="must be a whole number from 0"):
            env.reset(options={"trial": trial})
        with pytest.raises(InputError, match="must be a whole number from 0"):
            env.reset(seed=trial)  # type: ignore[arg-type]
    env.reset(options={"lerobot_new_rollout": True, **TRIAL})


def test_a_trial_that_is_named_is_the_same_every_time(env: APOInsert) -> None:
    """What is felt as well, whatever was done before; another seed has it felt otherwise."""

    def felt(**how: Any) -> bytes:
        env.reset(**how)
        wrench: Any = b"".join(env.step(np.zeros(7, dtype=np.float32))[0]["wrench"].tobytes() for _ in range(3))
        return bytes(wrench)

    first = felt(options=TRIAL)
    env.reset()
    assert felt(options=TRIAL) == first == felt(seed=TRIAL["trial"])
    trial = env.trial
    assert felt(seed=TRIAL["trial"] + 1, options=TRIAL) != first
    assert env.trial == trial


def test_starts_for_evaluation_are_as_many_as_seeds_and_none_is_for_training(monkeypatch: pytest.MonkeyPatch) -> None:
    evaluated = gymnasium.make("APOInsert-v0", scenario="block_on_block", starts="evaluation").unwrapped
    assert isinstance(evaluated, APOInsert)
    begin = TrialStarts.begin
    failed = Outcome("replay", "lost", None, "it fell")
    monkeypatch.setattr(TrialStarts, "begin", lambda self, t: failed if t in (2, 100_002) else begin(self, t))
    trials = []
    for seed in (0, 1, 2, 3):
        evaluated.reset(seed=seed)
        trials.append(evaluated.trial)
    assert trials == [0, 1, 200_002, 3]
    evaluated.reset()
    assert evaluated.trial < FIRST_TRAINING_TRIAL
    evaluated.reset(options={"trial": 1_000_001})
    assert evaluated.trial == 1_000_001
    monkeypatch.setattr(TrialStarts, "begin", lambda self, trial: failed)
    with pytest.raises(InputError, match="trial 5 fails before this operation: it fell"):
        evaluated.reset(seed=5)
