"""A part carried freely keeps its pose in the hand, and slips are recorded."""

import mujoco
import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, draw_layout, load_scenario, replay
from apo_bench.assembly import Step
from apo_bench.geometry import pose
from apo_bench.simulation.robot.in_hand import SLIPS_M, Carried, hold_steady
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.scene.world import get_part_pose, make_initial_state, set_part_pose
from tests.round_scenes import peg_in_hole

STAYS_MM = 0.03
"""It moves by some 0.01 mm before the first check, and between the last two checks."""


@pytest.fixture(scope="module")
def round_scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return build_scene(peg_in_hole(tmp_path_factory.mktemp("parts")))


def plan(scene: Scene, undo_last: bool = False) -> Plan:
    layout = draw_layout(scene.scenario, np.random.default_rng([1, 0]))
    last = len(scene.scenario.assembly) - 1
    steps = (*(Step(k) for k in range(last + 1)), *([Step(last, undo=True)] if undo_last else []))
    return Plan(scene.scenario.assembly, layout.start, layout.poses, steps)


def carried_mm(scene: Scene) -> list[float]:
    result = replay(plan(scene), scene)
    assert result.outcome.code == "ok"
    return [1e3 * each.carried_m for each in result.in_hand]


def test_what_is_carried_does_not_creep(round_scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """The documentation says by how much it would; where it would not, this file is no longer needed."""
    assert max(carried_mm(round_scene)) < STAYS_MM
    monkeypatch.setattr(Robot, "steady", lambda robot, on: None)
    alone = carried_mm(round_scene)
    assert all(0.15 < each < 0.85 for each in alone)


def test_a_group_is_put_back_as_one_and_what_touches_is_not_moved() -> None:
    scene = build_scene(load_scenario("stick_in_tower"))
    world = scene.work
    start = scene.scenario.start
    data = make_initial_state(world, start)
    mujoco.mj_step(world.model, data, 100)
    tip = pose.at((0.0, 0.0, 0.4))
    parts = ("stick", "castle1")
    resting = hold_steady(world, data, tip, Carried(parts, tip))
    assert resting.T_tip_part is None, "it stands on the table"
    set_part_pose(world, data, "stick", pose.at((0.1, 0.0, 0.3), (0.0, 0.0, 20.0)))
    set_part_pose(world, data, "castle1", pose.at((0.3, 0.1, 0.3)))
    mujoco.mj_forward(world.model, data)
    between = pose.inverse(get_part_pose(world, data, "stick")) @ get_part_pose(world, data, "castle1")
    free = hold_steady(world, data, tip, resting)
    kept = tip @ free.T_tip_part
    np.testing.assert_allclose(kept, get_part_pose(world, data, "stick"), atol=1e-12)
    data.qvel[:] = 0.5
    for by in (0.9, 1.1):
        shift = pose.at((0.0, by * SLIPS_M, 0.0))
        for part in parts:
            set_part_pose(world, data, part, shift @ get_part_pose(world, data, part))
        data.qvel[:] = 0.5
        after = hold_steady(world, data, tip, free)
        moved = np.linalg.norm((get_part_pose(world, data, "stick") - kept)[:3, 3])
        assert moved == pytest.approx(0.0 if by < 1.0 else by * SLIPS_M, abs=1e-9)
        assert (after is free) == (by < 1.0), "what slips is left where it slipped, and kept there"
        now = pose.inverse(get_part_pose(world, data, "stick")) @ get_part_pose(world, data, "castle1")
        np.testing.assert_allclose(now, between, atol=1e-9)
        assert (data.qvel == 0.5).all()
