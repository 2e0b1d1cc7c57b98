"""Motions that follow the wrist sensor, and that it measures what the contacts exert."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, build_scene, load_scenario
from apo_bench.geometry import Array, pose
from apo_bench.simulation.robot.by_wrist import comply, get_wrist, press, read_wrist, zero
from apo_bench.simulation.robot.gripper import list_gripper_boxes
from apo_bench.simulation.robot.in_hand import weld
from apo_bench.simulation.robot.paths import plan_steady_trajectory, smooth_trajectory, translate
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import READING_S, WristSensor, compute_part_loads
from apo_bench.simulation.scene.world import allow_sleep, get_part_pose, set_part_pose

DOWN = np.array([0.0, 0.0, -1.0])
UP = -DOWN


@cache
def scene_of(arm: str = "six_axis", grasp: str = "friction", step_s: float = 0.001) -> Scene:
    return build_scene(load_scenario("stick_in_tower"), arm=arm, grasp=grasp, timestep_s=step_s)


def empty_hand(scene: Scene, name: str, z: float, seed: int = 1) -> tuple[Robot, WristSensor]:
    """A robot whose wrist was zeroed, its closed hand above the table at a height of the tip, [m]."""
    robot = Robot(scene, scene.scenario.start)
    wrist = get_wrist(robot, name, np.random.default_rng(seed))
    robot.fingers(0.002)
    T = pose.at((0.0, 0.0, 0.0)) @ robot.T
    T[:3, 3] = 0.1, 0.16, 0.2
    robot.go(T, 0.8)
    zero(robot, wrist)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, DOWN, 0.2 - z), 0.3))
    robot.stand()
    return robot, wrist


def with_stick(grasp: str, name: str, along: float, lift: float = 0.05, **settings) -> tuple[Robot, WristSensor, Array]:
    """A robot that holds the stick this far from its middle, [m]; its wrist was zeroed before and knows the weight.

    Returns:
        Robot, wrist, and where the stick lies in the hand, (4, 4).
    """
    scene = scene_of(grasp=grasp)
    start = dict(scene.scenario.start)
    start["stick"] = pose.at((0.1, 0.16, 0.01))
    robot = Robot(scene, start)
    set_part_pose(scene.work, robot.data, "stick", start["stick"])
    wrist = get_wrist(robot, name, np.random.default_rng(1), **settings)
    T = np.array(robot.T)
    T[:3, 0] = 0.0, -1.0, 0.0
    T[:3, 1] = -1.0, 0.0, 0.0
    T[:3, 2] = DOWN
    T[:3, 3] = 0.1 + along, 0.16, 0.15
    robot.go(T, 0.8)
    zero(robot, wrist)
    robot.follow(smooth_trajectory(T, translate(T, DOWN, 0.138), 0.2))
    if grasp == "friction":
        robot.forces.handle("stick")
        robot.fingers(0.01 - robot.arm.squeeze_m)
    else:
        robot.fingers(0.012)
        weld(scene, robot.data, "stick", True)
    robot.forces.hold("stick")
    robot.stand()
    T_tip_stick = pose.inverse(robot.tip()) @ get_part_pose(scene.work, robot.data, "stick")
    wrist.hold(*compute_part_loads(scene, {"stick": T_tip_stick}))
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, UP, lift), 0.2))
    robot.stand()
    return robot, wrist, T_tip_stick


def mean_wrench(robot: Robot, wrist: WristSensor, about: Array, seconds: float = 0.1) -> Array:
    """The mean wrench while the robot stands, (6,)."""
    with read_wrist(robot, wrist):
        out = []
        for _ in range(round(seconds / 0.004)):
            robot.wait(0.004)
            out.append(wrist.wrench(about))
    return np.mean(out, axis=0)


@pytest.mark.parametrize(("grasp", "along"), [("friction", 0.06), ("weld", 0.0)])
def test_in_free_air_a_held_part_exerts_no_wrench(grasp: str, along: float) -> None:
    robot, wrist, _ = with_stick(grasp, "ideal", along)
    home = robot.T
    for turn in ((0, 0, 0), (0, 15, 30)):
        T = pose.at(home[:3, 3] + [0, 0, 0.05], turn) @ pose.inverse(pose.at(home[:3, 3])) @ home
        robot.go(T, 0.4)
        robot.stand(0.3)
        wrench = mean_wrench(robot, wrist, robot.T[:3, 3], 0.3)
        # The file says 0.518 N at its nominal size; made with clearance the stick weighs 0.026 N less.
        assert np.abs(wrench[:3]).max() < 0.04
        assert np.abs(wrench[3:]).max() < 0.003
    # A part that the sensor does not know acts with its weight and its lever.
    wrist.hold()
    assert mean_wrench(robot, wrist, robot.T[:3, 3])[2] == pytest.approx(-0.492, abs=0.01)


@pytest.mark.parametrize(("arm", "asleep"), [("six_axis", True), ("ur5e_primitive", False)])
def test_a_press_stops_where_the_hand_touches(arm: str, asleep: bool) -> None:
    scene = scene_of(arm)
    with allow_sleep(scene.work, asleep):
        robot, wrist = empty_hand(scene, "wrist", 0.014)
        left = press(robot, plan_steady_trajectory(robot.T, translate(robot.T, DOWN, 0.01), 0.002), DOWN, 2.0, wrist)
        assert left is not None
        assert robot.wrist is None
        assert np.linalg.norm(robot.T[:3, 3] - translate(robot.T, UP, 0.0)[:3, 3]) == 0.0
        reach = max(box.center[2] + box.half[2] for box in list_gripper_boxes(scene.kinematics, 0.002))
        assert robot.T[2, 3] == pytest.approx(reach, abs=5e-5)
        assert left == pytest.approx(robot.T[2, 3] - 0.004, abs=1e-4)


class Pushing:
    """Ahead along the vertical until the table pushes back by so much, and on for the rest of the time."""

    def __init__(self, newton: float, seconds: float) -> None:
        self.newton = newton
        self.left = round(seconds / READING_S)
        self.wrenches: list[Array] = []
        self.z = 0.0

    def __call__(self, wrench: Array) -> Array | None:
        self.wrenches.append(wrench)
        self.left -= 1
        self.z -= READING_S * float(np.clip(0.0005 * (self.newton - wrench[2]), -0.001, 0.001))
        return None if self.left < 0 else np.array([0.0, 0.0, self.z, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("arm", "newton"), [("six_axis", 2.0), ("panda_primitive", 2.0)])
def test_the_wrench_of_a_push_is_that_of_its_contacts(arm: str, newton: float) -> None:
    """Force and torque about the tip, against the contact sensor and the sum over all contacts, within 5 mN, 1 mNm."""
    scene = scene_of(arm)
    with allow_sleep(scene.work, False):
        robot, wrist = empty_hand(scene, "ideal", 0.0102)
        comply(robot, Pushing(newton, 1.5), robot.T[:3, 3], wrist)
        tip = robot.T[:3, 3]
        with read_wrist(robot, wrist):
            robot.wait(0.2)
            wrench = wrist.wrench(tip)
        assert wrench[2] == pytest.approx(newton, abs=0.02)
        assert wrench[:3] == pytest.approx(robot.forces._on_arm.sum(axis=0), abs=5e-3)
        assert wrench == pytest.approx(by_contacts(robot, tip), abs=5e-3)
        assert wrench[3:] == pytest.approx(by_contacts(robot, tip)[3:], abs=1e-3)


def by_contacts(robot: Robot, about: Array) -> Array:
    """What all contacts of the arm exert on it, (6,), about a point, from the simulation itself."""
    model, data = robot.model, robot.data
    total = np.zeros(6)
    force = np.zeros(6)
    for i, contact in enumerate(data.contact):
        arm = [model.geom(int(g)).name.startswith("arm/") for g in contact.geom]
        if any(arm):
            mujoco.mj_contactForce(model, data, i, force)
            # Pads resist turning: a contact of them has a torque, too.
            f, t = force.reshape(2, 3) @ contact.frame.reshape(3, 3) * (1.0 if arm[1] else -1.0)
            total += np.concatenate([f, np.cross(contact.pos - about, f) + t])
    return total
