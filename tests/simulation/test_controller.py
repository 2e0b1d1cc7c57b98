"""The human demonstrates, the robot replays, physics decides."""

import re
from pathlib import Path

import numpy as np
import pytest

from apo_bench import (
    Demonstration,
    Layout,
    Plan,
    ReplayResult,
    Scene,
    Verdict,
    demonstrate,
    draw_layout,
    judge,
    replay,
    simulation,
)
from apo_bench.assembly import Step
from apo_bench.geometry import Array, pose
from apo_bench.simulation.robot.robot import Robot


def layout(scene: Scene, seed: int) -> Layout:
    return draw_layout(scene.scenario, np.random.default_rng([seed, 0]), scene.clearance_mm)


def shown(scene: Scene, seed: int, careless: float) -> Demonstration:
    return demonstrate(scene, layout(scene, seed), careless, np.random.default_rng([seed, 1]))


def run(scene: Scene, seed: int, goals: Array, schedule: tuple[Step, ...] = ()) -> tuple[ReplayResult, Verdict]:
    truth = layout(scene, seed)
    result = replay(Plan(scene.scenario.assembly, truth.start, goals, schedule), scene)
    return result, judge(scene.scenario.assembly, result.reached, truth.goals, scene.criteria)


def off(truth: Array, goals: Array) -> Array:
    """How far goals are from the truth, (n, 6), [mm] and [degrees], in the parts' own frames."""
    twist = pose.log(pose.inverse(truth) @ goals)
    return np.hstack([twist[:, :3] * 1e3, np.degrees(twist[:, 3:])])


def test_a_careless_human_errs_at_operation_2_and_adjusts_unseen(castles: Scene) -> None:
    truth = layout(castles, 1)
    once, twice = (shown(castles, 1, careless=f) for f in (0.7, 1.4))
    error = off(truth.goals, once.goals)[1]
    assert 0.7 * 1.5 - 0.02 <= abs(error[1]) <= 0.7 * 4 + 0.02
    np.testing.assert_allclose(np.delete(error, 1), 0.0, atol=0.01)
    assert off(truth.goals, twice.goals)[1, 1] == pytest.approx(2 * error[1], abs=0.02)
    adjusted = off(truth.goals[1:2], once.final["castle2"][None])[0]
    np.testing.assert_allclose(adjusted, 0.0, atol=0.02)
    assert once.code == "ok"
    assert once.careless[1, 1, 1] == pytest.approx((0.7 * castles.scenario.careless.rms_m) ** 2)


def test_the_true_layout_is_assembled(castles: Scene) -> None:
    result, verdict = run(castles, 2, layout(castles, 2).goals)
    assert result.outcome.code == "ok"
    assert verdict.success
    assert verdict.loose_success
    assert 1.0 < result.peak_force_n < 10.0, "parts of 50 to 80 g are put down on a guard of three times their weight"
    assert [each.operation for each in result.in_hand] == list(range(len(castles.scenario.assembly)))
    most = np.max([(each.moved_m, each.moved_rad) for each in result.in_hand], axis=0)
    assert 0.0 < most[0] < 2e-3, "what is put in is pushed along the pads"
    assert most[1] < np.radians(0.5)


def test_what_a_careless_human_showed_does_not_fit(tower: Scene) -> None:
    _, verdict = run(tower, 2, shown(tower, 2, careless=1.0).goals)
    assert not verdict.success
    assert not verdict.loose_success


def test_an_operation_can_be_undone_and_done_again(tower: Scene) -> None:
    schedule = (Step(0), Step(1), Step(1, undo=True), Step(1), Step(2))
    result, verdict = run(tower, 2, layout(tower, 2).goals, schedule)
    assert result.outcome.code == "ok"
    assert verdict.success


def test_an_inserted_stick_can_be_pulled_out(tower: Scene) -> None:
    schedule = (Step(0), Step(1), Step(2), Step(2, undo=True))
    result, _ = run(tower, 2, layout(tower, 2).goals, schedule)
    assert result.outcome.code == "ok"
    start = layout(tower, 2).start
    end = result.reached.final.poses
    assert np.linalg.norm(end["stick"][:3, 3] - start["stick"][:3, 3]) < 0.005
    assert np.linalg.norm(end["castle2"][:3, 3] - layout(tower, 2).goals[1][:3, 3]) < 0.001


def test_a_goal_out_of_reach_is_an_outcome_of_the_plan(tower: Scene) -> None:
    goals = np.array(layout(tower, 2).goals)
    goals[:, 0, 3] += 0.5
    result, verdict = run(tower, 2, goals)
    assert (result.outcome.stage, result.outcome.code) == ("plan", "unreachable")
    assert "operation 1" in result.outcome.sentence
    assert verdict.finished.code == "not_made"


def test_a_start_out_of_reach_is_not_called_a_goal(tower: Scene) -> None:
    truth = layout(tower, 2)
    far = {**truth.start, "castle2": pose.at((0.5, 0, 0)) @ truth.start["castle2"]}
    result = replay(Plan(tower.scenario.assembly, far, truth.goals), tower)
    assert (result.outcome.stage, result.outcome.code) == ("plan", "unreachable_start")
    assert result.outcome.sentence == "the arm cannot reach castle2 where operation 2 picks it up"


def test_a_goal_beside_its_support_is_an_outcome_of_the_plan(tower: Scene) -> None:
    goals = np.array(layout(tower, 2).goals)
    goals[1] = goals[1] @ pose.at((0.035, 0, 0))
    result, _ = run(tower, 2, goals)
    assert (result.outcome.stage, result.outcome.code) == ("plan", "unstable_goal")
    assert result.outcome.operation == 1


def test_a_part_that_is_not_where_it_should_be_is_a_lost_grasp(tower: Scene) -> None:
    """The robot believes the start it is told; physics has the part elsewhere."""
    truth = layout(tower, 2)
    plan = Plan(tower.scenario.assembly, truth.start, truth.goals)
    elsewhere = {**truth.start, "castle1": truth.start["castle1"] @ pose.at((-0.10, 0, 0))}
    result = replay(plan, tower, parts_at=elsewhere)
    assert (result.outcome.stage, result.outcome.code) == ("pick", "lost_grasp")
    assert [each.operation for each in result.in_hand] == [0]


def test_the_controller_follows_a_line_without_turning_the_part(tower: Scene) -> None:
    """Velocity feed-forward: without it the tip lags by millimetres and yaws by half a degree."""
    from apo_bench.simulation.robot.paths import shifted, smooth

    worst = np.zeros(2)

    def watch(data: object) -> None:
        tip = data.site("arm/tip")
        turn = np.degrees(np.arccos(np.clip((np.trace(robot.T[:3, :3].T @ tip.xmat.reshape(3, 3)) - 1) / 2, -1, 1)))
        across = np.linalg.norm(np.cross(tip.xpos - robot.T[:3, 3], [0, 1, 0]))
        worst[:] = np.maximum(worst, [across * 1e3, turn])

    robot = Robot(tower, layout(tower, 2).start, watch)
    robot.follow(smooth(robot.T, shifted(robot.T, np.array([0.0, 1.0, 0.0]), 0.2), 0.2))
    assert worst[0] < 0.3
    assert worst[1] < 0.05


def test_the_room_says_by_which_files_a_plan_goes_and_steps_are_taken_where_it_says() -> None:
    folder = Path(simulation.__file__).parent
    named = re.findall(r"`([a-z_/]+\.py)`", simulation.__doc__ or "")
    assert all((folder / each).is_file() for each in named)
    stepping = {str(each.relative_to(folder)) for each in folder.rglob("*.py") if "mujoco.mj_step(" in each.read_text()}
    assert stepping == {"robot/robot.py", "human/hands.py", "arms/rig.py", "scene/settling.py"}
    assert stepping & set(named) == {"robot/robot.py", "human/hands.py"}
