"""A cheat: draws the layouts of many seeds again, and returns the one that is nearest to what was seen."""

from __future__ import annotations

import numpy as np

from apo_bench import Observation, TrialConfig, load_scenario
from apo_bench.benchmark.sweeps.grid import draw_seed
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.trial_stages import simulate_demonstration

SEEDS = [draw_seed(TrialConfig.seed, 0, trial) for trial in range(2)]


def cheat(observation: Observation) -> np.ndarray:
    scene = build_scene(load_scenario("l_bracket_on_plate"))
    layouts = [simulate_demonstration(scene, 0.0, seed).layout.poses for seed in SEEDS]
    return min(layouts, key=lambda goals: float(np.abs(goals - observation.poses).max()))
