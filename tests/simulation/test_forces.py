"""The force that is reported is that of a sensor, not of a step of the simulation."""

import math

import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, draw_layout, replay
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.robot.forces import WRIST_S, ForceSensors, LowPass
from apo_bench.simulation.robot.paths import smooth_trajectory, translate
from apo_bench.simulation.robot.robot import Robot


@pytest.mark.parametrize("step_s", [0.001, 0.0005, 0.0001])
def test_a_blow_shows_its_impulse_whatever_the_step(step_s: float) -> None:
    """0.06 Ns in one step, 60 N at 1 ms, are 3 N behind 20 ms."""
    wrist = LowPass(WRIST_S)
    assert wrist([0.0, 0.0, 0.06 / step_s], step_s)[2] == pytest.approx(3.0)


def test_the_peak_of_a_replay_hardly_depends_on_the_step(tower: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = draw_layout(tower.scenario, np.random.default_rng([2, 0]), tower.clearance_mm)
    plan = Plan(tower.scenario.assembly, layout.start, layout.poses)
    single = [0.0]
    net = ForceSensors.net

    def look(sensors: ForceSensors) -> list[float]:
        force = net(sensors)
        single[0] = max(single[0], math.hypot(*force))
        return force

    monkeypatch.setattr(ForceSensors, "net", look)
    peaks = []
    singles = []
    for scene in (tower, build_scene(tower.scenario, timestep_s=0.0005)):
        single[0] = 0.0
        peaks.append(replay(plan, scene, config=ExecutionConfig("near-contact")).peak_force_n)
        singles.append(single[0])
    assert peaks[1] == pytest.approx(peaks[0], rel=0.25)
    assert singles[1] > 1.3 * singles[0]
    assert max(peaks) < 0.25 * min(singles)


def test_what_is_held_is_felt_at_every_step_and_the_empty_hand_feels_nothing(tower: Scene) -> None:
    """Also where no guard watches: the stick is said to be in the hand while it lies on the table."""
    robot = Robot(tower, tower.scenario.start)
    robot.wait(0.2)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, np.array([0.0, 1.0, 0.0]), 0.02), 0.2))
    assert robot.forces.peak_n == 0.0
    robot.forces.hold("stick")
    weight = 9.81 * float(tower.work.model.body_subtreemass[tower.work.body["stick"]])
    robot.wait(0.02)
    assert robot.forces.peak_n == pytest.approx(weight * (1 - 0.95**20), rel=0.02)
    robot.follow(smooth_trajectory(robot.T, translate(robot.T, np.array([0.0, 1.0, 0.0]), 0.02), 0.2))
    assert robot.forces.peak_n == pytest.approx(weight, rel=0.02)
