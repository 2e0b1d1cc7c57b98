"""Grasps are chosen from planned poses: nothing is struck, and where one grasp cannot do it two can."""

from pathlib import Path

import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, load_scenario, replay
from apo_bench.assembly import Operation, Poses, Step, compute_placements
from apo_bench.geometry import Array, Box, measure_intrusion_depths, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.scenario.parts.making import Body, extrude, make_polygon, make_rectangle
from apo_bench.scenario.scenario import Grasp
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.grasp_clearance import RestingPart, list_obstacles
from apo_bench.simulation.execution.grasp_frame import half_width
from apo_bench.simulation.execution.grasping import grasp_at
from apo_bench.simulation.execution.prepare import Move, plan_moves
from apo_bench.simulation.execution.transfer import is_tilted
from apo_bench.simulation.robot.gripper import list_gripper_boxes
from apo_bench.simulation.robot.obstacles import make_obstacle
from tests.round_scenes import contacts, scenario


@pytest.fixture(scope="module")
def pockets() -> Scene:
    return build_scene(load_scenario("pocket_table"))


@pytest.fixture(scope="module")
def fixture() -> Scene:
    return build_scene(load_scenario("vanished_fixture"))


def nominal(scene: Scene, schedule: tuple[Step, ...] = ()) -> Plan:
    site = scene.scenario.site
    at = place_layout(scene.scenario, *site.center_m, sum(site.yaw_rad) / 2, clearance_mm=scene.clearance_mm)
    return Plan(scene.scenario.assembly, at.start, at.poses, schedule)


def depth(scene: Scene, move: Move, T_part: Array, T_tip: Array, opening: float, poses: Poses) -> float:
    """How deep the gripper is in any part but the moved one."""
    boxes = list_gripper_boxes(scene.kinematics, opening)
    T = T_part @ T_tip
    around = list_obstacles(scene.scenario.assembly.solids, poses, (move.transfer.part,))
    return max(float(measure_intrusion_depths(boxes, T[:3, :3], T[None, :3, 3], o.pieces, o.T)[0]) for o in around)


def test_a_long_stick_is_pushed_then_pulled(pockets: Scene) -> None:
    """Example of Fig. 6, step 5: no single grasp passes the cubes, so the grip changes between them."""
    plan = nominal(pockets)
    move = plan_moves(plan, pockets, False)[4]
    first, second = move.transfer.grips
    left = move.transfer.into.left
    assert left is not None
    assert 0.01 < left < 0.05
    assert first.T_part_tip[0, 3] < -0.05
    assert abs(second.T_part_tip[0, 3]) < 0.025
    poses = compute_placements(plan.assembly, plan.start, plan.target_poses)[4]
    goal = plan.target_poses[4]
    for back in np.linspace(move.transfer.into.travel, left, 60):
        at = goal @ pose.at((-back, 0, 0))
        assert depth(pockets, move, at, first.T_part_tip, first.half_width, poses) <= 0.0
    for back in np.linspace(left, 0.0, 20):
        at = goal @ pose.at((-back, 0, 0))
        assert depth(pockets, move, at, second.T_part_tip, second.half_width + 0.008, poses) <= 0.0


def test_side_contacts_are_slid_onto_and_left_sideways_and_a_fixture_comes_back_the_same_way(fixture: Scene) -> None:
    schedule = (*(Step(k) for k in range(4)), Step(3, undo=True))
    done = plan_moves(nominal(fixture, schedule), fixture, False)
    towards = fixture_side(fixture)
    (side,) = done[2].transfer.sides
    np.testing.assert_allclose(side, towards, atol=1e-9)
    (back,) = done[4].transfer.sides
    np.testing.assert_allclose(back, -towards, atol=1e-9)
    assert not done[0].transfer.sides
    assert not done[3].transfer.sides
    (away,) = done[3].transfer.away
    np.testing.assert_allclose(away, towards, atol=1e-9)
    assert not any(move.transfer.away for move in (*done[:3], done[4]))


def fixture_side(scene: Scene) -> Array:
    """From castle 2 to the cube."""
    return nominal(scene).target_poses[2][:3, 1]


SIDEWAYS = Grasp(np.array([0.018, 0.0, 0.026]), np.array([0.0, 1.0, 0.0]))


def one_part(folder: Path, body: Body, grasp: Grasp, density: float = 1000.0, friction: float = 0.8) -> Scene:
    """A part that is put down elsewhere on the table."""
    operation = Operation("part", contacts("part", "bottom-table.top"))
    start = {"part": pose.at((0, 0.25, 0))}
    return build_scene(scenario(folder, {"part": body}, [operation], [np.eye(4)], start, [grasp], density, friction))


def bracket() -> Body:
    """L-shaped, standing on its foot."""
    names = ("bottom", "end", "tread", "inner", "tip", "back")
    outline = make_polygon((0, 0), (60, 0), (60, 10), (10, 10), (10, 40), (0, 40), names=names)
    return extrude(outline, -10, 10).moved((0, 0, 0), (90, 0, 0))


def test_where_a_wall_stands_a_bracket_is_held_by_its_other_sides(tmp_path: Path) -> None:
    scene = one_part(tmp_path, bracket(), SIDEWAYS)
    T = scene.scenario.start["part"]
    around = list_obstacles(scene.scenario.assembly.solids, scene.scenario.start, ("part",))
    wall = make_obstacle((Box("wall", np.array([0.018, 0.03, 0.03]), np.array([0.03, 0.005, 0.03])),), T)
    assert grasp_at(scene, "part", SIDEWAYS, [RestingPart(T, around)]) is SIDEWAYS
    grasp = grasp_at(scene, "part", SIDEWAYS, [RestingPart(T, (*around, wall))])
    assert abs(grasp.across[0]) == 1.0
    assert half_width(scene.pieces["part"], grasp, T) == pytest.approx(0.005)


def test_the_robot_takes_a_bar_with_a_tilted_hand(tmp_path: Path) -> None:
    ahead = np.array([-0.5, 0.0, -np.sqrt(0.75)])
    bar = extrude(make_rectangle(60, 20), 0, 40, bottom="bottom")
    scene = one_part(tmp_path, bar, Grasp(np.array([0.0, 0.0, 0.03]), np.array([0.0, 1.0, 0.0]), ahead=ahead))
    for yaw in (0.2, np.pi):  # one of them is reached the other way round
        layout = place_layout(scene.scenario, 0.1, 0.0, yaw)
        plan = Plan(scene.scenario.assembly, layout.start, layout.poses)
        (move,) = plan_moves(plan, scene, False)
        np.testing.assert_allclose(move.transfer.grips[0].T_part_tip[:3, 2], ahead, atol=1e-12)
        assert is_tilted(move.transfer.T_world_start @ move.transfer.grips[0].T_part_tip)
    layout = place_layout(scene.scenario, 0.1, 0.0, 0.2)
    result = replay(
        Plan(scene.scenario.assembly, layout.start, layout.poses), scene, config=ExecutionConfig("near-contact")
    )
    assert result.outcome.code == "ok"
