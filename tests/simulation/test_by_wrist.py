"""Contact forces on the arm from fixed and sleeping parts."""

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, build_scene, load_scenario
from apo_bench.geometry import pose
from apo_bench.simulation.robot.paths import plan_steady_trajectory, smooth_trajectory, translate
from apo_bench.simulation.robot.robot import ExecutionAborted, Robot
from apo_bench.simulation.scene.world import allow_sleep, set_part_pose

DOWN = np.array([0.0, 0.0, -1.0])
HARDEST_N = 40.0
"""An arm pushes with 100 to 200 N per mm, and at 4 mm/s goes 0.08 mm between two looks: up to 16 N on top of 20 N."""


def hand_at(scene: Scene, x: float, y: float, z: float) -> Robot:
    """A robot whose empty hand stands closed somewhere, [m]."""
    robot = Robot(scene, scene.scenario.start)
    robot.fingers(0.002)
    T = pose.at((0.0, 0.0, 0.0)) @ robot.T
    T[:3, 3] = x, y, 0.2
    robot.go(T, 0.8)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, DOWN, 0.2 - z), 0.3))
    robot.stand()
    return robot


def push_on_table(scene: Scene, robot: Robot) -> float:
    """What the table and the arm really exert on each other, [N], from the forces of all their contacts."""
    total = np.zeros(3)
    force = np.zeros(6)
    names = [scene.work.model.geom(g).name for g in range(scene.work.model.ngeom)]
    for i, contact in enumerate(robot.data.contact):
        if {names[contact.geom1].split("/")[0], names[contact.geom2].split("/")[0]} == {"arm", "table"}:
            mujoco.mj_contactForce(scene.work.model, robot.data, i, force)
            total += contact.frame.reshape(3, 3).T @ force[:3]
    return float(np.linalg.norm(total))


@pytest.mark.parametrize(("arm", "asleep"), [("six_axis", True), ("ur5e_primitive", False)])
def test_an_empty_hand_that_presses_on_the_table_is_stopped(arm: str, asleep: bool) -> None:
    """By its base, which cannot move either, the arm felt nothing of the table, and pressed with 320 N."""
    scene = build_scene(load_scenario("stick_in_tower"), arm=arm)
    with allow_sleep(scene.work, asleep):
        robot = hand_at(scene, 0.1, 0.16, 0.02)
        with pytest.raises(ExecutionAborted) as aborted:
            robot.follow(plan_steady_trajectory(robot.T, translate(robot.T, DOWN, 0.025), 0.004))
        assert (aborted.value.code, aborted.value.part) == ("collision", "table")
        assert 20.0 < push_on_table(scene, robot) < HARDEST_N


def test_a_sleeping_part_exerts_no_force(tower: Scene) -> None:
    """The hand lifts off between two looks, the part comes to rest, and its sensor must not keep what it felt last."""
    robot = Robot(tower, tower.scenario.start)
    with allow_sleep(tower.work, True):
        robot.wait(0.1)
        sensors = robot.data.sensordata.reshape(-1, 3)[len(tower.work.free) :]
        sensors[:] = 1.0
        set_part_pose(tower.work, robot.data, "castle1", tower.scenario.start["castle1"])
        robot.wait(0.1)
        assert robot.forces.load() == 0.0
