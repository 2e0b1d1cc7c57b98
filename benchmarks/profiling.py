"""Where the time of a replay goes: `python benchmarks/profiling.py`.

Writes docs/results/speed.md and results/profile.json. The physics and the inverse kinematics are timed inside
replays, in time of the processor, so a busy machine matters little.
"""

from __future__ import annotations

import cProfile
import io
import json
import math
import platform
import pstats
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco

from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.stages import observe_demonstration, simulate_demonstration

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "profile.json"
TIMES = ROOT / "benchmarks" / "results" / "trial_times.json"
PAGE = ROOT / "docs" / "results" / "speed.md"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table", "peg_in_hole")
METHODS = ("uncorrected", "paper", "paper-track")
SEEDS = (0, 1, 2)


class Clock:
    """Adds up the processor time of calls."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*args: Any, **kwargs: Any) -> Any:
            began = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                self.seconds += time.process_time() - began

        return timed


def main() -> None:
    scenes = {name: build_scene(load_scenario(name)) for name in SCENARIOS}
    shares = [
        share(scenes[name], method, fidelity)
        for name in SCENARIOS
        for method in METHODS
        for fidelity in ("full", "contact")
    ]
    found = {
        "command": "python benchmarks/profiling.py",
        "versions": {"mujoco": mujoco.__version__, "python": platform.python_version()},
        "seeds": list(SEEDS),
        "shares": shares,
        "profile": profile(scenes["pocket_table"]),
    }
    KEPT.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    PAGE.write_text("\n".join(page(found)) + "\n", encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def share(scene: Scene, method: str, fidelity: str) -> dict[str, Any]:
    """Shares of the processor time of replays of a few seeds: level 1, careless humans."""
    plans = [planned(scene, method, seed) for seed in SEEDS]
    step = mujoco.mj_step
    inverse = Kinematics.inverse
    physics = Clock()
    kinematics = Clock()
    whole = 0.0
    passed = 0.0
    mujoco.mj_step = physics.around(step)
    Kinematics.inverse = kinematics.around(inverse)
    try:
        for each in plans:
            began = time.process_time()
            passed += replay(each, scene, config=ExecutionConfig(fidelity)).sim_time_s
            whole += time.process_time() - began
    finally:
        mujoco.mj_step = step
        Kinematics.inverse = inverse
    return {
        "scenario": scene.scenario.name,
        "method": method,
        "fidelity": fidelity,
        "replays": len(plans),
        "seconds": round(whole / len(plans), 3),
        "mj_step": round(physics.seconds / whole, 4),
        "inverse_kinematics": round(kinematics.seconds / whole, 4),
        "real_time_factor": round(passed / whole, 1),
    }


def planned(scene: Scene, method: str, seed: int) -> Any:
    """What a method would have the robot do."""
    shown = simulate_demonstration(scene, 1.0, seed)
    made = apply_method(
        method, observe_demonstration(shown, make_noise("isotropic", NoiseLevel(1.0, 1.0)), seed), shown.layout.poses
    )
    assert made.plan is not None, made.failure
    return made.plan


def profile(scene: Scene, lines: int = 15) -> list[str]:
    """The functions in which one replay at full fidelity spends most time themselves, under the profiler."""
    todo = planned(scene, "paper", 0)
    watch = cProfile.Profile()
    told = io.StringIO()
    watch.enable()
    replay(todo, scene)
    watch.disable()
    pstats.Stats(watch, stream=told).strip_dirs().sort_stats("tottime").print_stats(lines)
    head = next(i for i, line in enumerate(told.getvalue().splitlines()) if line.lstrip().startswith("ncalls"))
    return [line.rstrip() for line in told.getvalue().splitlines()[head : head + lines + 1]]


def page(found: dict[str, Any]) -> list[str]:
    shares = found["shares"]
    full = [s for s in shares if s["fidelity"] == "full"]
    least = math.floor(100 * min(s["mj_step"] for s in full))
    most = math.ceil(100 * max(s["inverse_kinematics"] for s in full))
    return [
        "# Where the time of a replay goes",
        "",
        f"Written by `{found['command']}`: level 1, careless humans, seeds {found['seeds']}, one process, MuJoCo "
        f"{found['versions']['mujoco']}. A replay is everything from a plan to the poses reached: grasps, inverse "
        f"kinematics, physics. At full fidelity at least {least} % of the processor time is inside `mj_step` and "
        f"at most {most} % is inverse kinematics. The real-time factor counts what `contact` passes over; "
        "it depends on the machine, so compare it within the table only. Seconds are of the processor.",
        "",
        "| scenario | method | fidelity | seconds | in `mj_step` | inverse kinematics | real-time factor |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {s['scenario']} | `{s['method']}` | {s['fidelity']} | {s['seconds']:.2f} | {100 * s['mj_step']:.0f} % "
            f"| {100 * s['inverse_kinematics']:.1f} % | {s['real_time_factor']:.0f} |"
            for s in shares
        ),
        "",
        *compared(),
        "The functions in which a replay of `pocket_table` at full fidelity spends most time themselves, as the "
        "profiler sees them (it slows Python down, not the physics):",
        "",
        "```",
        *found["profile"],
        "```",
    ]


def compared() -> list[str]:
    """What `trial_times.py` measured last, if anything."""
    found = json.loads(TIMES.read_text(encoding="utf-8")) if TIMES.exists() else {}
    return [*by_fidelity(found.get("fidelities")), *by_scenario(found.get("scenarios"))]


def by_fidelity(found: dict[str, Any] | None) -> list[str]:
    """Of the four examples of the paper."""
    if found is None:
        return []
    lines = [
        f"A whole trial with its demonstration, at {found['before']} and at {found['after']}, in turn in one run "
        f"(`{found['command']}`): the four examples, `none`, `paper` and `contact` at level 1, careless humans.",
        "",
        "| fidelity | trials | median seconds | median ratio | in CPU time | real-time factor | verdicts that differ |",
        "|---|---|---|---|---|---|---|",
    ]
    for fidelity, f in found["fidelity"].items():
        lines.append(
            f"| {fidelity} | {f['trials']} | {pair(f['wall_s'])} | {f['wall_ratio']:.2f} | {f['cpu_ratio']:.2f} "
            f"| {pair(f['real_time_factor'])} | {f['verdicts_differ']} |"
        )
    return [*lines, ""]


def by_scenario(found: dict[str, Any] | None) -> list[str]:
    """Of others, each by itself."""
    if found is None:
        return []
    lines = [
        f"Other scenarios at fidelity `near-contact`, at {found['before']} and at {found['after']}, in turn in one run "
        f"(`{found['command']}`), level 1, careless humans. Seconds are of the processor, and so are the factors: "
        f"{found['load'][0]:.0f} processes wanted the {found['cores']} cores when it began, {found['load'][1]:.0f} "
        "when it ended. Numba is installed ([what for](../how/simulated.md#round-parts)); it compiles before the clock "
        "starts.",
        "",
        "| scenario | trials | a trial, seconds | median ratio | faster than real time | scene, seconds "
        "| verdicts that differ |",
        "|---|---|---|---|---|---|---|",
    ]
    for scenario, f in found["scenario"].items():
        lines.append(
            f"| {scenario} | {f['trials']} | {pair(f['cpu_s'])} | {f['cpu_ratio']:.2f} "
            f"| {pair(f['cpu_real_time_factor'])} | {pair(f['scene_s'])} | {f['verdicts_differ']} |"
        )
    return [*lines, ""]


def pair(before_and_after: list[float]) -> str:
    return " to ".join(f"{x:g}" for x in before_and_after)


if __name__ == "__main__":
    sys.exit(main())
