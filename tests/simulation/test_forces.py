"""The force that is reported is that of a sensor, not of a step of the simulation."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from apo_bench import Plan, Scene, build_scene, draw_layout, replay
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.robot.forces import WRIST_S, LowPass


@pytest.mark.parametrize("step_s", [0.001, 0.0005, 0.0001])
def test_a_blow_shows_its_impulse_whatever_the_step(step_s: float) -> None:
    """0.06 Ns in one step, 60 N at 1 ms, are 3 N behind 20 ms."""
    wrist = LowPass(WRIST_S)
    assert wrist([0.0, 0.0, 0.06 / step_s], step_s)[2] == pytest.approx(3.0)


def test_the_peak_of_a_replay_hardly_depends_on_the_step(tower: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = draw_layout(tower.scenario, np.random.default_rng([2, 0]), tower.clearance_mm)
    plan = Plan(tower.scenario.assembly, layout.start, layout.poses)
    single = [0.0]
    take_up = LowPass.__call__

    def look(low_pass: LowPass, force: Sequence[float], seconds: float) -> list[float]:
        single[0] = max(single[0], math.hypot(*force))
        return take_up(low_pass, force, seconds)

    monkeypatch.setattr(LowPass, "__call__", look)
    peaks = []
    singles = []
    for scene in (tower, build_scene(tower.scenario, timestep_s=0.0005)):
        single[0] = 0.0
        peaks.append(replay(plan, scene, config=ExecutionConfig("near-contact")).peak_force_n)
        singles.append(single[0])
    assert peaks[1] == pytest.approx(peaks[0], rel=0.25)
    assert singles[1] > 1.3 * singles[0]
    assert max(peaks) < 0.25 * min(singles)
