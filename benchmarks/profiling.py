"""Measure where the processor time of a replay goes: `python benchmarks/profiling.py` (two minutes).

Writes docs/results/speed.md. Calls of the physics and of the inverse kinematics are timed inside replays, in processor
time, so a busy machine matters little.
"""

from __future__ import annotations

import cProfile
import io
import itertools
import platform
import pstats
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import mujoco

from apo_bench.assembly import Plan
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.stages import observe_demonstration, simulate_demonstration
from benchmarks.provenance import with_mujoco
from benchmarks.rates_by_condition import table

PAGE = Path(__file__).parents[1] / "docs" / "results" / "speed.md"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table", "peg_in_hole")
METHODS = ("uncorrected", "paper", "paper-track")
FIDELITIES = ("full", "near-contact")
SEEDS = range(3)
LINES = 15  # of the profile


@contextmanager
def timed(owner: Any, name: str) -> Iterator[list[float]]:
    """Collect the processor times of the calls of a function, [s]."""
    spent: list[float] = []
    function: Callable[..., Any] = getattr(owner, name)

    def call(*args: Any, **kwargs: Any) -> Any:
        begun = time.process_time()
        try:
            return function(*args, **kwargs)
        finally:
            spent.append(time.process_time() - begun)

    setattr(owner, name, call)
    try:
        yield spent
    finally:
        setattr(owner, name, function)


def measure(scene: Scene, method: str, fidelity: str) -> tuple[object, ...]:
    """Return a line of the table: time of a replay, and the shares of physics and kinematics."""
    plans = [make_plan(scene, method, seed) for seed in SEEDS]
    with timed(mujoco, "mj_step") as physics, timed(Kinematics, "inverse") as kinematics:
        begun = time.process_time()
        simulated_s = sum(replay(plan, scene, config=ExecutionConfig(fidelity)).sim_time_s for plan in plans)
        whole_s = time.process_time() - begun
    shares = (f"{100 * sum(physics) / whole_s:.0f} %", f"{100 * sum(kinematics) / whole_s:.1f} %")
    times = (f"{whole_s / len(plans):.2f}", *shares, f"{simulated_s / whole_s:.0f}")
    return scene.scenario.name, f"`{method}`", fidelity, *times


def make_plan(scene: Scene, method: str, seed: int) -> Plan:
    """Return the plan of a method at 1 mm and 1 degree, with human error."""
    shown = simulate_demonstration(scene, 1.0, seed)
    observation = observe_demonstration(shown, make_noise("isotropic", NoiseLevel(1.0, 1.0)), seed)
    made = apply_method(method, observation, shown.layout.poses)
    assert made.plan is not None, made.failure
    return made.plan


def profile(scene: Scene) -> str:
    """Return the functions in which one replay at full fidelity spends most time themselves."""
    plan = make_plan(scene, "paper", 0)
    profiler = cProfile.Profile()
    profiler.runcall(replay, plan, scene)
    text = io.StringIO()
    pstats.Stats(profiler, stream=text).strip_dirs().sort_stats("tottime").print_stats(LINES)
    lines = text.getvalue().splitlines()
    head = next(i for i, line in enumerate(lines) if line.lstrip().startswith("ncalls"))
    return "\n".join(line.rstrip() for line in lines[head : head + LINES + 1])


def main() -> None:
    scenes = {name: build_scene(load_scenario(name)) for name in SCENARIOS}
    rows = [measure(scenes[name], *rest) for name, *rest in itertools.product(SCENARIOS, METHODS, FIDELITIES)]
    heads = ("scenario", "method", "fidelity", "seconds", "in `mj_step`", "inverse kinematics", "real-time factor")
    lines = [
        "# Speed of a replay",
        "",
        "Written by `python benchmarks/profiling.py`: 1 mm and 1 degree, human error, "
        f"{len(SEEDS)} seeds, one process, Python {platform.python_version()}. A replay is everything from a plan to "
        "the poses reached: grasps, inverse kinematics, physics. Seconds are processor time. The real-time factor "
        "counts the stretches that `near-contact` passes over; it depends on the machine.",
        "",
        *table(heads, rows),
        "",
        "The functions in which a replay of `pocket_table` at full fidelity spends most time, by the profiler, which "
        "slows down Python but not the physics:",
        "",
        "```",
        profile(scenes["pocket_table"]),
        "```",
    ]
    PAGE.write_text(with_mujoco("\n".join(lines) + "\n", [mujoco.__version__]), encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
