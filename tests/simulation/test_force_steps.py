"""Steps of a motion under force control: the same as one by one, and checked once a tick."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.simulation.robot import ForceSteps, Robot


def test_the_steps_of_a_tick_are_those_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Down onto the support, with 50 steps an action, which end within a tick of 20."""
    env = APOInsert("block_on_block", grasp="weld", robot_error="none")
    looks = []
    check = Robot.check_state
    monkeypatch.setattr(Robot, "check_state", lambda self: looks.append(self.data.time) or check(self))

    def felt(step: object) -> tuple[np.ndarray, list[float]]:
        monkeypatch.setattr(ForceSteps, "step", step)
        env.reset(options={"trial": 3})
        looks.clear()
        seen = [env.step(np.zeros(6, np.float32))[0] for _ in range(6)]
        return np.array([np.concatenate([each["agent_pos"], each["wrench"]]) for each in seen]), [*looks]

    usual = ForceSteps.step

    def slowly(self: ForceSteps, q: np.ndarray, velocity: np.ndarray) -> list[float]:
        force = usual(self, q, velocity)
        axes = self._net @ self._contacts
        assert force == axes.tolist()
        assert np.array_equal(self._robot.data.sensordata[: len(self._contacts)], self._contacts)
        return force

    fast, at = felt(usual)
    slow, _ = felt(slowly)
    np.testing.assert_array_equal(fast, slow)
    np.testing.assert_allclose(np.diff(at[:15]), 0.02, atol=1e-9)
