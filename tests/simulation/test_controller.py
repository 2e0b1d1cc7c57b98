"""The human demonstrates, the robot replays, physics decides."""

import numpy as np

from apo_bench import Layout, Plan, ReplayResult, Scene, Verdict, draw_layout, judge, replay
from apo_bench.assembly import Step
from apo_bench.geometry import Array, pose
from apo_bench.simulation.robot.robot import Robot


def layout(scene: Scene, seed: int) -> Layout:
    return draw_layout(scene.scenario, np.random.default_rng([seed, 0]), scene.clearance_mm)


def run(scene: Scene, seed: int, goals: Array, schedule: tuple[Step, ...] = ()) -> tuple[ReplayResult, Verdict]:
    truth = layout(scene, seed)
    result = replay(Plan(scene.scenario.assembly, truth.start, goals, schedule), scene)
    return result, judge(scene.scenario.assembly, result.reached, truth.poses, scene.criteria)


def test_the_true_layout_is_assembled(castles: Scene) -> None:
    result, verdict = run(castles, 2, layout(castles, 2).poses)
    assert result.outcome.code == "ok"
    assert verdict.success
    assert verdict.loose_success
    assert 1.0 < result.peak_force_n < 10.0, "parts of 50 to 80 g are put down on a guard of three times their weight"
    assert [each.operation for each in result.in_hand] == list(range(len(castles.scenario.assembly)))
    most = np.max([(each.moved_m, each.moved_rad) for each in result.in_hand], axis=0)
    assert 0.0 < most[0] < 2e-3, "what is put in is pushed along the pads"
    assert most[1] < np.radians(0.5)


def test_a_goal_out_of_reach_is_an_outcome_of_the_plan(tower: Scene) -> None:
    goals = np.array(layout(tower, 2).poses)
    goals[:, 0, 3] += 0.5
    result, verdict = run(tower, 2, goals)
    assert (result.outcome.stage, result.outcome.code) == ("plan", "unreachable")
    assert "operation 1" in result.outcome.sentence
    assert verdict.finished.code == "not_made"


def test_a_goal_beside_its_support_is_an_outcome_of_the_plan(tower: Scene) -> None:
    goals = np.array(layout(tower, 2).poses)
    goals[1] = goals[1] @ pose.at((0.035, 0, 0))
    result, _ = run(tower, 2, goals)
    assert (result.outcome.stage, result.outcome.code) == ("plan", "unstable_goal")
    assert result.outcome.operation == 1


def test_a_part_that_is_not_where_it_should_be_is_a_lost_grasp(tower: Scene) -> None:
    """The plan states one start; physics has the part elsewhere."""
    truth = layout(tower, 2)
    plan = Plan(tower.scenario.assembly, truth.start, truth.poses)
    elsewhere = {**truth.start, "castle1": truth.start["castle1"] @ pose.at((-0.10, 0, 0))}
    result = replay(plan, tower, parts_at=elsewhere)
    assert (result.outcome.stage, result.outcome.code) == ("pick", "lost_grasp")
    assert [each.operation for each in result.in_hand] == [0]


def test_the_controller_follows_a_line_without_turning_the_part(tower: Scene) -> None:
    """Velocity feed-forward: without it the tip lags by millimetres and yaws by half a degree."""
    from apo_bench.simulation.robot.paths import smooth_trajectory, translate

    worst = np.zeros(2)

    def watch(data: object) -> None:
        tip = data.site("arm/tip")
        turn = np.degrees(np.arccos(np.clip((np.trace(robot.T[:3, :3].T @ tip.xmat.reshape(3, 3)) - 1) / 2, -1, 1)))
        across = np.linalg.norm(np.cross(tip.xpos - robot.T[:3, 3], [0, 1, 0]))
        worst[:] = np.maximum(worst, [across * 1e3, turn])

    robot = Robot(tower, layout(tower, 2).start, watch)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, np.array([0.0, 1.0, 0.0]), 0.2), 0.2))
    assert worst[0] < 0.3
    assert worst[1] < 0.05
