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
from apo_bench.envs.episode_start import EpisodeStart, TrialStarts
from apo_bench.errors import InputError
from apo_bench.records import FIRST_TRAINING_TRIAL

TRIAL = {"trial": 3}
STILL = np.zeros(6, dtype=np.float32)


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
    aside = np.array([0.5, 0, 0, 0, 0, 0.5], dtype=np.float32)
    along = aside + np.array([0, 0, 1, 0, 0, 0], dtype=np.float32)
    after = run(env, *[along] * 2, *[aside] * 8)[-1][0]
    moved = after["agent_pos"] - before["agent_pos"]
    np.testing.assert_allclose(moved[:6], [2, 0, 2, 0, 0, 1.5], atol=0.15)
    np.testing.assert_allclose(after["plan"][13:], [2, 0, 2, 0, 0, 1.5], rtol=1e-6)
    back = run(env, *[STILL] * 8)[-1][0]
    np.testing.assert_allclose(back["agent_pos"][:2], before["agent_pos"][:2], atol=0.15)


def test_every_step_has_the_depth_the_force_and_the_phase(env: APOInsert) -> None:
    env.reset(options=TRIAL)
    over = False
    phases = []
    while not over:
        _, _, over, _, info = env.step(STILL)
        assert info["force_n"] >= 0.0
        phases.append(info["phase"])
        assert info["success_at_end"] is info["success"] is over
    assert (phases[0], phases[-1]) == ("approach", "released")
    assert info["success_once"]


def test_depth_in_the_hole_is_rewarded_once_and_an_approach_past_it_not_at_all() -> None:
    env = APOInsert(corrector="oracle", robot_error="none", reward="progress")
    for aside, least, most in ((0.0, 0.1, 1.0), (1.0, 0.0, 0.0)):
        env.reset(options=TRIAL)
        ahead, back = (np.array([0, aside, along, 0, 0, 0], dtype=np.float32) for along in (0, -1))
        won = [reward for _, reward, *_ in run(env, *[ahead] * 20, *[back] * 20)]
        assert least <= sum(won) <= most
        again = [reward for _, reward, *_ in run(env, *[back] * 4)]
        assert sum(again) == 0.0


def test_force_above_the_observed_threshold_costs() -> None:
    env = APOInsert("block_on_block", grasp="weld", force_penalty=0.5, penalised_n=0.001)
    seen, _ = env.reset(options=TRIAL)
    assert seen["plan"][12] == np.float32(0.001)
    over = False
    paid = 0.0
    while not over:
        _, reward, over, _, info = env.step(STILL)
        if not over:
            assert reward == pytest.approx(-0.5 * max(info["force_n"] - 0.001, 0.0))
            paid += reward
    assert paid < 0.0


def test_the_group_critic_has_the_truth_and_the_group_policy_the_rest() -> None:
    env = APOInsert("block_on_block", grasp="weld", critic=True)
    seen, _ = env.reset(options=TRIAL)
    assert env.observation_groups == {"policy": ("agent_pos", "plan", "wrench"), "critic": ("critic",)}
    np.testing.assert_allclose(seen["critic"][:3], 1e3 * env.off[:3], rtol=1e-5, atol=1e-6)
    assert seen["critic"][9] == 0.0
    touched = []
    over = False
    while not over:
        touched.append(seen["critic"][9])
        seen, _, over, _, _ = env.step(STILL)
    assert touched[-1] == 1.0


def test_actions_beyond_their_range_are_clipped(env: APOInsert) -> None:
    def after(action: Any) -> Any:
        env.reset(options=TRIAL)
        return run(env, action, action)[-1][0]

    large = np.array([3, -2, 0, 1, 0, 0], dtype=np.float32)
    assert same(after(large), after(np.clip(large, -1, 1)))


def test_with_a_gripper_a_seventh_number_opens_the_hand() -> None:
    env = APOInsert("block_on_block", grasp="weld", gripper=True)
    env.reset(options=TRIAL)
    assert env.action_space.shape == (7,)
    _, _, terminated, truncated, info = env.step(np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32))
    assert (terminated, truncated, info["phase"]) == (True, False, "released")


def test_physics_and_sensor_vary_only_when_asked_and_each_episode_ends_it() -> None:
    env = APOInsert("block_on_block", randomise=1.0)
    model = env.scene.work.model
    names = ("geom_friction", "body_mass", "actuator_gainprm")
    usual = [getattr(model, name).copy() for name in names]
    frictions = []
    for _ in range(2):
        env.reset(options=TRIAL)
        frictions.append(model.geom_friction.copy())
        assert all(not np.array_equal(getattr(model, name), before) for name, before in zip(names, usual, strict=True))
    np.testing.assert_array_equal(*frictions)  # the same trial varies in the same way
    assert env.observation_space.contains(run(env, STILL)[0][0])
    copied = pickle.loads(pickle.dumps(env))
    assert same(copied.step(STILL)[0], env.step(STILL)[0])
    env._restore_physics()
    assert all(np.array_equal(getattr(model, name), before) for name, before in zip(names, usual, strict=True))


def test_the_pool_has_as_many_starts_as_layouts_even_where_trials_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    env = APOInsert("block_on_block", grasp="weld", layouts=3)
    begin = TrialStarts.begin
    failed = Outcome("replay", "lost", None, "it fell")
    monkeypatch.setattr(TrialStarts, "begin", lambda self, t: failed if t < 1_100_000 else begin(self, t))
    trials = set()
    for _ in range(60):  # all but one in 10^10 such draws have all three
        env.reset()
        trials.add(env.trial)
    assert trials == {1_100_000, 1_100_001, 1_100_002}
    assert all(isinstance(start, EpisodeStart) for start in env._pool.kept.values())


@pytest.mark.parametrize(("name", "horizon", "most"), [("APOInsert-v0", 500, 500), ("APOAssemble-v0", 300, 600)])
def test_the_limit_of_gymnasium_is_the_horizon(name: str, horizon: int, most: int) -> None:
    env = gymnasium.make(name, scenario="block_on_block", horizon=horizon)
    assert env.spec is not None
    assert env.spec.max_episode_steps == most
    assert gymnasium.make(env.spec).get_wrapper_attr("most_actions") == most


def test_the_hand_opens_at_the_time_limit_and_the_episode_is_truncated() -> None:
    env = APOInsert("block_on_block", grasp="weld", horizon=2)
    env.reset(options=TRIAL)
    first, second = run(env, STILL, STILL)
    assert first[2:4] == (False, False)
    assert not first[4]["success"]
    assert second[2:4] == (False, True)
    assert second[4]["code"] != ""


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"operation": 3}, "operation 3"),
        ({"corrector": "oracle+probe"}, "takes a corrector without"),
        ({"starts": "test"}, "unknown kind of starts 'test'"),
        ({"reward": "dense"}, "unknown reward 'dense'"),
        ({"pixels": "front"}, "unknown camera 'front'"),
        ({"randomise": -1}, "randomise -1"),
    ],
)
def test_wrong_arguments_are_refused_in_one_sentence(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        APOInsert("block_on_block", **wrong)


def test_wrong_calls_are_refused_in_one_sentence(env: APOInsert) -> None:
    env.reset(options=TRIAL)
    with pytest.raises(InputError, match=r"shape \(7,\) from 2 to 2 was given .* shape \(6,\) with finite"):
        env.step(np.full(7, 2.0, dtype=np.float32))
    with pytest.raises(InputError, match="finite numbers is needed"):
        env.step(np.full(6, np.nan, dtype=np.float32))
    with pytest.raises(InputError, match="option of reset"):
        env.reset(options={"noise": 2})
    with pytest.raises(InputError, match="'forward' was given as an action"):
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
        wrench: Any = b"".join(env.step(STILL)[0]["wrench"].tobytes() for _ in range(3))
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
    with pytest.raises(InputError, match="trial 5 fails before this operation, as do its 9 replacements: it fell"):
        evaluated.reset(seed=5)
