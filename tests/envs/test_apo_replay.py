"""The door for learners, as Gymnasium and its users expect it."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import apo_bench
from apo_bench import Correction, InputError, Observation, Scene, TrialConfig, correct, run_trial
from apo_bench.assembly import Outcome, Step
from apo_bench.envs import episode, robot
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.geometry import pose
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import outcomes
from apo_bench.simulation.execution import execution as record_replays
from apo_bench.trial.trial_stages import SimulatedDemonstration, reobservations_of, simulate_demonstration

SEED = 5
REPLAY = "apo_bench.envs.robot.replay_and_judge"


@pytest.fixture(scope="module")
def env() -> Iterator[APOReplay]:
    """One environment for the module: its episodes must not depend on each other."""
    made = gymnasium.make("APOReplay-v0", grasp="weld").unwrapped
    assert isinstance(made, APOReplay)
    yield made
    made.close()


@pytest.fixture
def small() -> APOReplay:
    """Two blocks: for what is so whatever is assembled."""
    return APOReplay("block_on_block", grasp="weld")


@cache
def demonstrated(scene: Scene, human_error_scale: float, seed: int, pose_source: str) -> SimulatedDemonstration:
    return simulate_demonstration(scene, human_error_scale, seed, pose_source)


@pytest.fixture
def watched(env: APOReplay) -> Iterator[APOReplay]:
    """The same environment, its demonstrations shown once: for tests of what comes after them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(episode, "simulate_demonstration", demonstrated)
        yield env


def zeros(env: Any) -> Any:
    return np.zeros(env.action_space.shape)


def gives_up(seen: Observation) -> Correction:
    return Correction(seen.poses, "inconsistent", "the contacts cannot all hold", (), 1e-3, 1e-3, 0)


def test_reset_fits_the_spaces(env: APOReplay) -> None:
    seen, info = env.reset(seed=SEED)
    assert env.observation_space.contains(seen)
    assert {key: value.shape for key, value in seen.items()} == {
        "poses": (3, 7),
        "covariance": (3, 6, 6),
        "observed": (3,),
    }
    assert all(np.isfinite(box.low).all() and np.isfinite(box.high).all() for box in _boxes(env))
    assert env.action_space.shape == (3, 6)
    np.testing.assert_array_equal(seen["poses"], pose.pack(env.observation.poses))
    np.testing.assert_array_equal(seen["covariance"], env.observation.covariance)
    assert env.observation.assembly is env.assembly
    assert info == {"demonstration": "ok"}
    assert env.trial == SEED


def _boxes(env: APOReplay) -> list[Any]:
    return [env.action_space, env.observation_space["poses"], env.observation_space["covariance"]]


def test_a_seed_is_a_trial_whatever_came_before(env: APOReplay) -> None:
    first, _ = env.reset(seed=SEED)
    other, _ = env.reset()
    drawn, _ = env.reset(seed=SEED)
    assert not np.array_equal(first["poses"], other["poses"])
    np.testing.assert_array_equal(first["poses"], drawn["poses"])
    after, _ = env.reset()
    np.testing.assert_array_equal(other["poses"], after["poses"])


def test_an_episode_is_the_row_of_its_trial(small: APOReplay) -> None:
    """Zeros, corrected, are method `paper` of `apo-bench run --seed`."""
    row = run_trial(TrialConfig("block_on_block", grasp="weld", method="paper", seed=SEED), small._scene)
    assert row["success"] is True
    _check_episode(apo_bench.CorrectPoses(small, "paper"), row)
    reached = {part: [*(pose.pack(T)[:3] * 1e3), *pose.pack(T)[3:]] for part, T in small._rendering.poses.items()}
    assert reached == row["final_poses"]


def _check_episode(env: Any, row: dict[str, Any]) -> None:
    env.reset(seed=SEED)
    _, reward, terminated, truncated, info = env.step(zeros(env))
    assert (reward, terminated, truncated) == (float(row["success"]), True, False)
    assert (info["is_success"], info["loose_success"]) == (row["success"], row["loose_success"])
    stage = row["failure_stage"] or "done"
    code = row["failure_code"] or "ok"
    assert (info["stage"], info["code"], info["sentence"]) == (stage, code, row["sentence"])
    assert info["operation"] == row["failure_operation"]
    assert info["failure_prediction"] == row["failure_prediction"]


def _nothing() -> Any:
    from types import SimpleNamespace as Record

    outcome = Outcome("plan", "unreachable", 0, "the arm cannot reach it")
    result = Record(outcome=outcome, reached=Record(final=None))
    return Record(result=result, verdict=Record(success=False, as_demonstrated=False, loose_success=False))


def test_correction_aims_and_an_action_composes_on_top(watched: APOReplay, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(REPLAY, lambda plan, *_, **__: asked.append(plan) or _nothing())
    corrected = apo_bench.CorrectPoses(watched, "apo_bench.correction.baselines.paper:paper")
    seen, info = corrected.reset(seed=SEED)
    assert info["correction"] == "converged"
    assert not np.array_equal(seen["poses"], pose.pack(watched.observation.poses))
    twist = np.full((3, 6), 0.01)
    after, *_ = corrected.step(twist)
    np.testing.assert_allclose(asked[0].target_poses, pose.unpack(seen["poses"]) @ pose.exp(twist), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(after["poses"], seen["poses"])
    watched.reset(seed=SEED)
    watched.step(zeros(watched))
    np.testing.assert_array_equal(asked[1].target_poses, watched.observation.poses)


def test_looks_of_an_episode_are_those_of_its_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    """A corrector that can ask gets them; what it does with them stays out of what was seen at first."""

    class Asks:
        def __call__(self, seen: Observation) -> Any:
            return pytest.fail("it can look again")

        def correct_and_reobserve(self, seen: Observation, look: Any) -> Any:
            again.append(look([1]))
            return correct(seen, "contact")

    again: list[Observation] = []
    made = APOReplay("block_on_block", grasp="weld", noise="outliers", max_reobservations=2)
    monkeypatch.setattr(episode, "simulate_demonstration", demonstrated)
    corrected = apo_bench.CorrectPoses(made, Asks())
    corrected.reset(seed=SEED)
    assert again[0].observed.tolist() == [False, bool(again[0].observed[1])]
    assert not np.array_equal(again[0].poses[1], made.observation.poses[1])
    assert (made.reobserve.left, made.reobserve.reobservations) == (1, 1)
    copied = copy.deepcopy(made)
    second = made.reobserve([0, 1])
    np.testing.assert_array_equal(copied.reobserve([0]).poses, second.poses)
    with pytest.raises(InputError, match="no reobservation is left"):
        made.reobserve([0])
    corrected.reset(seed=SEED)
    np.testing.assert_array_equal(again[1].poses, again[0].poses)
    simulated = demonstrated(made._scene, 1.0, SEED, "noise")
    look = reobservations_of(simulated, make_noise("outliers", NoiseLevel(1.0, 1.0)), SEED, 1)
    np.testing.assert_array_equal(look([1]).poses, again[0].poses)


def test_a_correction_that_fails_is_not_executed(watched: APOReplay, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(REPLAY, lambda *_: pytest.fail("nothing may be replayed"))
    corrected = apo_bench.CorrectPoses(watched, gives_up)
    seen, info = corrected.reset(seed=SEED)
    assert info["correction"] == "inconsistent"
    np.testing.assert_array_equal(seen["poses"], pose.pack(watched.observation.poses))
    _, reward, terminated, _, info = corrected.step(zeros(watched))
    assert (reward, terminated, info["stage"], info["code"]) == (0.0, True, "correct", "inconsistent")
    assert "failure_prediction" not in info


def rebuilds(seen: Observation) -> Correction:
    """Example 5.1: castle 2 is put down as it was seen, taken off, and put down rightly."""
    made = correct(seen, "paper")
    schedule = (Step(0), Step(1), Step(1, undo=True), Step(1), Step(2))
    targets = made.poses[[step.operation for step in schedule]]
    targets[1:3] = seen.poses[1]
    return replace(made, schedule=schedule, step_poses=targets)


def test_a_schedule_is_executed_and_an_action_acts_on_every_target(
    watched: APOReplay, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(REPLAY, lambda plan, *_, **__: asked.append(plan) or _nothing())
    corrected = apo_bench.CorrectPoses(watched, rebuilds)
    corrected.reset(seed=SEED)
    made = rebuilds(watched.observation)
    twist = np.linspace(-0.02, 0.02, 18).reshape(3, 6)
    corrected.step(twist)
    corrected.reset(seed=SEED)
    corrected.step(zeros(watched))
    assert asked[0].schedule == asked[1].schedule == made.schedule
    moved = made.step_poses @ pose.exp(twist)[[0, 1, 1, 1, 2]]
    np.testing.assert_allclose(asked[0].step_poses, moved, rtol=0, atol=1e-15)
    np.testing.assert_allclose(asked[0].target_poses, made.poses @ pose.exp(twist), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(asked[1].step_poses, made.step_poses)


def test_info_never_holds_the_truth(watched: APOReplay) -> None:
    _, first = watched.reset(seed=SEED)
    _, _, _, _, info = watched.step(np.full((3, 6), 0.05))
    said = info.pop("failure_prediction")
    assert set(said) == {"fails", "operation", "code", "size_mm"}
    assert 0.0 <= info.pop("predicted_success") <= 1.0
    verdicts = {"is_success", "success", "as_demonstrated", "loose_success"}
    assert set(info) == verdicts | {"stage", "code", "operation", "sentence"}
    assert set(first) == {"demonstration"}
    assert info["stage"] in (*outcomes.STAGES, "done")
    assert info["code"] in outcomes.CODES
    assert all(isinstance(value, (bool, str, int, type(None))) for value in info.values())
    assert {f.name for f in fields(watched.observation)} == {
        *("assembly", "start", "poses", "covariance", "observed", "gap_m", "play_m", "outliers", "shared", "tails")
    }


def test_simulated_time_has_a_limit(watched: APOReplay, monkeypatch: pytest.MonkeyPatch) -> None:
    watched.reset(seed=SEED)
    again = (Step(0), Step(0, undo=True)) * 600
    watched.aim(watched.observation.poses, (*again, *(Step(k) for k in range(3))))
    monkeypatch.setattr(record_replays, "plan_moves", _nothing)
    info = watched.step(zeros(watched))[4]
    assert [info[key] for key in ("is_success", "stage", "code", "operation")] == [False, "plan", "time_limit", 1]
    monkeypatch.undo()
    monkeypatch.setattr(robot, "LONGEST_REPLAY_S", 5.0)
    watched.reset(seed=SEED)
    info = watched.step(zeros(watched))[4]
    assert [info[key] for key in ("is_success", "stage", "code")] == [False, "pick", "time_limit"]
    assert info["operation"] > 1
    assert info["sentence"] == "the trial took longer than its limit"


def test_one_step_is_one_episode(watched: APOReplay) -> None:
    fresh = APOReplay("block_on_block")
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        fresh.step(zeros(watched))
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        _ = fresh.observation
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        _ = fresh.trial
    watched.reset(seed=SEED)
    watched.step(np.full((3, 6), 0.05))
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
        watched.step(zeros(watched))


def test_an_operation_that_was_not_seen_is_not_replayed(monkeypatch: pytest.MonkeyPatch) -> None:
    from apo_bench.perception.observation.models.isotropic import IsotropicNoise
    from apo_bench.perception.observation.noise import NoiseLevel

    def blind(assembly: Any, shown: Any, rng: Any) -> Observation:
        full = IsotropicNoise(NoiseLevel(1.0, 1.0))(assembly, shown, rng)
        return Observation(assembly, full.start, full.poses, full.covariance, np.array([True, False]))

    env = APOReplay("block_on_block", noise=blind)
    seen, _ = env.reset(seed=SEED)
    assert seen["observed"].tolist() == [1, 0]
    _, reward, _, _, info = env.step(zeros(env))
    assert (reward, info["stage"], info["code"], info["operation"]) == (0.0, "observe", "not_seen", 2)
    for corrector, ended in (("contact", ("correct", "not_seen")), ("contact-robust", ("done", "ok"))):
        corrected = apo_bench.CorrectPoses(env, corrector)
        corrected.reset(seed=SEED)
        _, _, _, _, info = corrected.step(zeros(env))
        assert (info["stage"], info["code"]) == ended


def test_a_failed_demonstration_is_kept_for_its_seed_and_passed_over_without(
    watched: APOReplay, monkeypatch: pytest.MonkeyPatch
) -> None:
    import apo_bench.envs.episode as module

    real = module.simulate_demonstration
    calls = []

    def fails_at_first(scene: Any, human_error_scale: float, seed: int, pose_source: str) -> Any:
        calls.append(seed)
        shown = real(scene, human_error_scale, seed, pose_source)
        if len(calls) > 1:
            return shown
        return replace(shown, demonstration=replace(shown.demonstration, code="demonstration_failed"))

    monkeypatch.setattr(module, "simulate_demonstration", fails_at_first)
    _, info = watched.reset(seed=SEED)
    assert info["demonstration"] == "demonstration_failed"
    _, reward, terminated, _, info = watched.step(zeros(watched))
    assert (reward, terminated, info["stage"], info["is_success"]) == (0.0, True, "demonstrate", False)
    calls.clear()
    _, info = watched.reset()
    assert info["demonstration"] == "ok"
    assert watched.trial == calls[1] != calls[0]


def test_an_unknown_argument_names_the_nearest() -> None:
    with pytest.raises(InputError, match="unknown argument of APOReplay 'noise_levl'; did you mean 'noise_level'"):
        APOReplay(noise_levl=1)


def test_an_environment_without_reobservations_names_the_setting(small: APOReplay) -> None:
    small.reset(seed=0)
    with pytest.raises(InputError, match="give a larger max_reobservations"):
        small.reobserve([0])


def test_a_picture_without_a_display(small: APOReplay) -> None:
    small.reset(seed=SEED)
    assert small.render() is None
    small.render_mode = "rgb_array"
    try:
        before = small.render()
        small.step(zeros(small))
        after = small.render()
    finally:
        small.render_mode = None
    assert (before.shape, before.dtype) == ((480, 640, 3), np.uint8)
    assert before.std() > 10
    assert small._rendering.state is not None
    assert small._rendering.state.shape == small._scene.work.model.qpos0.shape
    assert np.abs(before.astype(int) - after.astype(int)).max() > 50


@pytest.mark.slow
def test_gymnasium_finds_nothing_to_warn_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make("APOReplay-v0", scenario="block_on_block")
        check_env(made.unwrapped, skip_render_check=True)
        made.reset(seed=0)
        made.step(zeros(made))
        check_env(gymnasium.make("APOReplay-v0", scenario="block_on_block", render_mode="rgb_array").unwrapped)
        made = gymnasium.make("APOReplay-v0")
        made.reset(seed=0)
        made.step(np.full((3, 6), 0.05))
