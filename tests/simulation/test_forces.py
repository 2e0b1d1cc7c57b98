"""The force that is reported is that of a sensor, not of a step of the simulation."""

import mujoco
import numpy as np
import pytest

from apo_bench.scenario import load_scenario
from apo_bench.simulation.robot import Robot
from apo_bench.simulation.robot.forces import WRIST_S, LowPass
from apo_bench.simulation.scene import build_scene, compute_only


@pytest.mark.parametrize("step_s", [0.001, 0.0005, 0.0001])
def test_a_blow_shows_its_impulse_whatever_the_step(step_s: float) -> None:
    """0.06 Ns in one step, 60 N at 1 ms, are 3 N behind 20 ms."""
    wrist = LowPass(WRIST_S)
    assert wrist([0.0, 0.0, 0.06 / step_s], step_s)[2] == pytest.approx(3.0)


def test_forces_of_several_steps_are_filtered_as_one_by_one() -> None:
    forces = np.random.default_rng(0).normal(size=(20, 3))
    by_step, at_once = LowPass(WRIST_S), LowPass(WRIST_S)
    wanted = [by_step(force, 0.001) for force in forces]
    np.testing.assert_allclose(at_once.filter_steps(forces, 0.001), wanted, rtol=0, atol=1e-12)
    assert at_once.force == pytest.approx(by_step.force)


def test_sensors_that_are_computed_once_a_tick_read_as_those_of_its_last_step() -> None:
    scene = build_scene(load_scenario("block_on_block"))
    always, once = (Robot(scene, scene.scenario.start).data for _ in range(2))
    model = scene.work.model
    mujoco.mj_step(model, always, 20)
    with compute_only(model, once, [0]):
        mujoco.mj_step(model, once, 20)
    assert np.abs(always.sensordata).max() > 0.7  # the weight of a block on the table, [N]
    np.testing.assert_array_equal(once.sensordata, always.sensordata)
    np.testing.assert_array_equal(once.qpos, always.qpos)
