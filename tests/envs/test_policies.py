"""Policies of APOInsert-v0: teacher, searches, and how they are evaluated."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from apo_bench import InputError, TrialConfig
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.evaluation import evaluate_policy, find_reason
from apo_bench.envs.policies import POLICIES, expert, insert_env, straight
from apo_bench.envs.searcher import Searcher
from apo_bench.envs.spiral import SpiralPolicy
from apo_bench.names import resolve


def test_the_teacher_goes_where_the_part_really_has_to_go() -> None:
    env = insert_env(TrialConfig("stick_in_tower", method="contact-robust", noise_mm=1.0, noise_deg=1.0))
    seen, _ = env.reset(options={"trial": 3})
    for _ in range(2):
        seen, *_ = env.step(np.array([1, 1, -1, 0, 0, 1], dtype=np.float32))
    first = env.off
    act = expert(env)
    for _ in range(5):
        seen, *_ = env.step(np.float32(act(seen)))
    assert np.linalg.norm(first[:2]) > 1e-3
    assert np.linalg.norm(env.off[:2]) < 0.2 * np.linalg.norm(first[:2])
    assert first[2] < env.off[2] < 0.0
    assert straight(env)(seen).tolist() == [0.0] * 6


def test_a_robot_that_is_right_by_its_settings_gets_the_usual_error_of_the_environment() -> None:
    wrong = {error: insert_env(TrialConfig("block_on_block", robot_error=error)).spec for error in ("none", "tool:1")}
    assert [spec.kwargs["robot_error"] for spec in wrong.values() if spec] == ["hand_eye:0.5/0.1", "tool:1"]


@pytest.fixture(scope="module")
def env() -> APOInsert:
    made = gymnasium.make("APOInsert-v0", scenario="block_on_block", grasp="weld").unwrapped
    assert isinstance(made, APOInsert)
    return made


def observe(
    left: float,
    push: float,
    side: tuple[float, float] = (0.0, 0.0),
    deviations: tuple[float, float] = (0.3, 0.8),
    tip: Any = (0.0, 0.0),
) -> Any:
    """An observation: distance left [mm], push back and side force [N], lateral deviations and position [mm]."""
    plan = np.zeros(19)
    plan[3] = left
    plan[6:8] = deviations
    plan[11] = 1.0
    return {"agent_pos": np.array([*tip, *np.zeros(11)]), "wrench": np.array([*side, -push, 0, 0, 0]), "plan": plan}


def stop(policy: Any, actions: int, **felt: Any) -> np.ndarray:
    """The actions after the approach was stopped at 50 mm."""
    for left in (60.0, 55.0, 50.0):
        assert not policy(observe(left, 0.0)).any()
    return np.array([policy(observe(50.0, 1.0, **felt)) for _ in range(actions)])


def test_the_searcher_sweeps_the_axis_that_is_unknown(env: APOInsert) -> None:
    swept = 4.0 * stop(Searcher(env), 200, deviations=(0.05, 0.8))[:, :2]  # [mm]
    assert np.ptp(swept[:, 0]) == 0.0
    assert np.ptp(swept[:, 1]) > 2.0
    assert np.quantile(np.abs(np.diff(swept[:, 1])), 0.98) < 0.6  # but for the ways back to the middle
    both = 4.0 * stop(Searcher(env), 400, deviations=(0.8, 0.8))[:, :2]
    assert (np.ptp(both, axis=0) > 2.0).all()


def test_the_searcher_moves_only_against_resistance_and_rests_after_each_step(env: APOInsert) -> None:
    searcher = Searcher(env)
    moved = np.abs(np.diff(4.0 * stop(searcher, 60)[10:, :2], axis=0)).max(axis=1) > 1e-9
    assert moved.any()
    assert not (moved[1:] & moved[:-1]).any()
    free = np.array([searcher(observe(50.0, 0.0)) for _ in range(10)])
    assert np.ptp(free, axis=0).max() == 0.0


def test_the_searcher_follows_walls_that_hold_the_part_and_no_friction(env: APOInsert) -> None:
    for side, follows in ((0.8, False), (1.8, True)):
        ends = 4.0 * stop(Searcher(env), 60, deviations=(0.1, 0.1), side=(side, 0.0))[:, 0]
        assert (ends[-1] - ends[4] > 0.5) == follows


def test_the_searcher_begins_again_with_another_turn_where_walls_hold_the_part_in_place(env: APOInsert) -> None:
    friction, walls = (stop(Searcher(env), 30, side=(side, 0.0)) for side in (1.8, 4.0))
    assert np.ptp(friction[:, 5]) == 0.0
    assert np.ptp(walls[:, 5]) > 0.0
    assert np.ptp(4.0 * walls[10:, 0]) < 0.6  # it stays near the beginning


def test_where_the_part_dipped_in_the_searcher_searches_close_by_with_another_turn(env: APOInsert) -> None:
    searcher = Searcher(env)
    before = 4.0 * stop(searcher, 60, deviations=(0.8, 0.8))[-1, :2]
    for _ in range(6):
        searcher(observe(49.4, 1.0, deviations=(0.8, 0.8), tip=before))
    actions = np.array([searcher(observe(49.4, 1.0, deviations=(0.8, 0.8), tip=before)) for _ in range(20)])
    assert np.abs(4.0 * actions[:, :2] - before).max() < 0.8
    assert actions[:, 5].any()


def test_the_searcher_is_stopped_by_a_contact_ahead_only(env: APOInsert) -> None:
    for push, searches in ((0.0, False), (1.0, True)):
        searcher = Searcher(env)
        searcher(observe(60.0, 0.0))
        moved = np.array([searcher(observe(50.0, push)) for _ in range(40)])
        assert moved.any() == searches


def test_the_searcher_goes_in_while_walls_do_not_rub_and_searches_where_it_is_stuck(env: APOInsert) -> None:
    searcher = Searcher(env)
    stop(searcher, 10)
    assert [searcher(observe(48.0 - k, 0.0))[2] for k in range(8)][-1] > 0.0
    rubbed = [searcher(observe(40.0, 0.0, side=(0.5, 0.0))) for _ in range(4)]
    assert [action[2] for action in rubbed] == [-1.0, 0.0, 0.0, 0.0]  # it takes the last millimetre back, and stands
    assert rubbed[-1][0] > rubbed[0][0]
    stuck = np.array([searcher(observe(40.0, 1.0)) for _ in range(120)])
    assert np.ptp(stuck[40:, 1]) > 0.1


def stop_beyond_a_hole(policy: Any, actions: int, slip: float, left: float = 20.0, **felt: Any) -> np.ndarray:
    """The positions of a tip that yields by `slip` [mm] with each action, after a second stop 20 mm before the end."""
    stop(policy, 10)
    tips = [np.zeros(2)]
    for k in range(20):
        policy(observe(48.0 - 1.4 * k, 0.0))
    for _ in range(4):
        policy(observe(20.0, 1.0))
    for k in range(actions):
        tips.append(4.0 * policy(observe(left, 1.0, tip=tips[-1], **felt))[:2] - (slip * k, 0.0))
    return np.array(tips[1:])


def test_beyond_a_hole_the_searcher_goes_in_circles_and_makes_up_for_what_the_tip_yields(env: APOInsert) -> None:
    for slip in (0.0, 0.02):
        tips = stop_beyond_a_hole(Searcher(env), 200, slip)
        assert np.ptp(tips, axis=0) == pytest.approx([3.0, 3.0], abs=0.6)  # twice the smaller deviation, three times
        assert np.abs(tips.mean(axis=0)).max() < 0.3


def test_beyond_a_hole_the_searcher_follows_side_forces_only_where_the_part_dips_in(env: APOInsert) -> None:
    for left, follows in ((20.0, False), (19.8, True)):
        tips = stop_beyond_a_hole(Searcher(env), 60, 0.0, left, deviations=(0.05, 0.05), side=(3.0, 0.0))
        assert (tips[-1, 0] > 0.5) == follows


def test_the_spiral_covers_its_radius_and_goes_on_with_a_turn(env: APOInsert) -> None:
    actions = stop(SpiralPolicy(env), 600)
    across = 4.0 * np.hypot(*actions[:, :2].T)
    assert across.max() == pytest.approx(2.0, abs=0.1)
    assert {round(3.0 * turn) for turn in actions[:, 5]} >= {0, 1}


def test_policies_are_evaluated_by_name_and_as_functions_of_the_observation(env: APOInsert) -> None:
    (result,) = evaluate_policy(env, "straight", [3])
    assert (result.trial, result.success, result.reason, result.code) == (3, True, "", "ok")
    assert result.actions > 5

    def back(base: APOInsert) -> Any:
        return lambda observation: np.array([0, 0, -1.0, 0, 0, 0])

    (failed,) = evaluate_policy(gymnasium.make("APOInsert-v0", corrector="oracle", horizon=2), back, [3])
    assert (failed.success, failed.reason, failed.actions) == (False, "never entered", 2)
    assert all(callable(resolve(name, POLICIES, "policy")) for name in POLICIES)
    with pytest.raises(InputError, match="unknown policy 'spirl'; did you mean 'spiral'"):
        evaluate_policy(env, "spirl", [3])


@pytest.mark.parametrize(
    ("info", "deepest", "truncated", "reason"),
    [
        ({"code": "force_stop", "success_once": False}, 5.0, False, "force"),
        ({"code": "pushed", "success_once": True}, 50.0, False, "moved parts"),
        ({"code": "gap", "success_once": False}, 0.2, True, "never entered"),
        ({"code": "gap", "success_once": False}, 20.0, True, "out of time"),
        ({"code": "gap", "success_once": False}, 20.0, False, "stopped inside"),
    ],
)
def test_each_failure_has_one_reason(info: dict[str, Any], deepest: float, truncated: bool, reason: str) -> None:
    assert find_reason(info, deepest, truncated) == reason
