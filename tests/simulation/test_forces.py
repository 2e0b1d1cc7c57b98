"""The force that is reported is that of a sensor, not of a step of the simulation."""

import pytest

from apo_bench.simulation.robot.forces import WRIST_S, LowPass


@pytest.mark.parametrize("step_s", [0.001, 0.0005, 0.0001])
def test_a_blow_shows_its_impulse_whatever_the_step(step_s: float) -> None:
    """0.06 Ns in one step, 60 N at 1 ms, are 3 N behind 20 ms."""
    wrist = LowPass(WRIST_S)
    assert wrist([0.0, 0.0, 0.06 / step_s], step_s)[2] == pytest.approx(3.0)
