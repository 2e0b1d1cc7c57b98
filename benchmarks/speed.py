"""Where the time goes: `python benchmarks/speed.py` (two minutes, one core).

Prints the real-time factor of a whole replay, what a demonstration and a reset cost, and which part of a replay is
spent in MuJoCo's step. Medians; the same replays are timed in turn, so that a machine whose speed drifts treats all
alike. A bare scene at rest is stepped in between as a yardstick of the machine.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import cProfile
import pstats
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np

import apo_bench  # noqa: F401
from apo_bench.assembly import Plan
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.stages import simulate_demonstration

ROUNDS = 5


def timed(verb: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = verb()
    return time.perf_counter() - start, result


def yardstick(scene: Scene) -> float:
    """Microseconds per step of the replay scene at rest."""
    data = mujoco.MjData(scene.work.model)
    mujoco.mj_step(scene.work.model, data, 200)
    return timed(lambda: mujoco.mj_step(scene.work.model, data, 1000))[0] * 1e3


def measure(name: str) -> None:
    scenario = load_scenario(name)
    compiled, scene = timed(lambda: build_scene(scenario))
    rows = []
    for seed in range(ROUNDS):
        rest = yardstick(scene)
        shown_s, shown = timed(lambda seed=seed: simulate_demonstration(scene, 1.0, seed))
        plan = Plan(scenario.assembly, shown.layout.start, shown.layout.goals)
        replay_s, result = timed(lambda plan=plan: replay(plan, scene))
        rows.append((rest, shown_s, replay_s, result.sim_seconds / replay_s, result.sim_seconds))
    rest, shown_s, replay_s, factor, simulated = np.median(rows, axis=0)
    print(f"{name}: compiled once in {compiled:.2f} s; scene at rest {rest:.0f} us a step")
    print(f"  replay {replay_s:.2f} s for {simulated:.1f} s simulated: real-time factor {factor:.1f}")
    print(f"  demonstration {shown_s:.2f} s")
    print(f"  reset beyond the demonstration {reset_overhead(name):.1f} ms")
    profile = cProfile.Profile()
    profile.runcall(replay, plan, scene)
    shares(pstats.Stats(profile))


def reset_overhead(name: str) -> float:
    """Median milliseconds of a reset beyond its demonstration, each pair measured in turn."""
    env = gymnasium.make("APOReplay-v0", scenario=name)
    scene = env.unwrapped._scene
    env.reset(seed=0)
    extra = []
    for seed in range(ROUNDS):
        shown_s, _ = timed(lambda seed=seed: simulate_demonstration(scene, 1.0, seed))
        reset_s, _ = timed(lambda seed=seed: env.reset(seed=seed))
        again_s, _ = timed(lambda seed=seed: simulate_demonstration(scene, 1.0, seed))
        extra.append(reset_s - (shown_s + again_s) / 2)
    return float(np.median(extra)) * 1e3


def shares(stats: Any) -> None:
    """Parts of one profiled replay; the profiler makes Python look slower than it is."""
    whole = stats.total_tt
    rows = {"mj_step": ("mj_step", 2), "inverse kinematics": ("inverse", 3), "looking for trouble": ("_look", 3)}
    for what, (function, column) in rows.items():
        spent = sum(
            v[column]
            for k, v in stats.stats.items()
            if function == k[2].strip("<>").split(".")[-1].rstrip(">") or (function == "mj_step" and "mj_step" in k[2])
        )
        print(f"  {what:20s} {spent / whole:6.1%}")


if __name__ == "__main__":
    for scenario_name in ("stick_in_tower", "stick_on_castles"):
        measure(scenario_name)
