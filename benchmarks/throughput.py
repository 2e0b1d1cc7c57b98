"""Control steps a second of the environments: `python -m benchmarks.throughput --others PYTHON`.

Steps of one core, by the processor's time, under random actions; vectors of `APOInsert-v0`, the asynchronous ones by
the wall, so that a machine that does nothing else is needed; memory over many episodes. PYTHON is of an environment in
which others run (`pip install mujoco==3.8.1 robosuite metaworld gym-taskboard`); theirs and ours take turns. Writes
results/throughput.json and docs/results/throughput.md; --only parts of it, and what was measured before is kept.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import apo_bench  # noqa: F401  # registers the environments
from benchmarks.measured_parts import measured
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "throughput.json"
PAGE = ROOT / "docs" / "results" / "throughput.md"
SCENARIOS = ("dovetail", "stick_in_tower", "pocket_table", "gearbox", "peg_in_hole")
OURS = 20
"""Actions a second of simulated time."""
STEPS = 400
ROUNDS = 3
SMALL = 0.2
"""Of an action: what is pushed harder ends its episode early."""
TASKS = {
    "robosuite Lift": 20,
    "robosuite NutAssemblySquare": 20,
    "robosuite TwoArmPegInHole": 20,
    "Meta-World peg-insert-side-v3": 80,
    "gym-taskboard Pegs": 20,
}
"""Of others -> actions a second of simulated time."""
PROGRAM = """
import json, sys, time, warnings
warnings.filterwarnings("ignore")
import numpy as np, gymnasium
name, steps = sys.argv[1], int(sys.argv[2])
which, task = name.split(" ", 1)
rng = np.random.default_rng(0)
if which == "robosuite":
    import robosuite
    robots = ["Panda", "Panda"] if task.startswith("TwoArm") else "Panda"
    seen = dict(has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False)
    env = robosuite.make(task, robots=robots, control_freq=20, hard_reset=False, **seen)
    low, high = env.action_spec
    step = lambda: env.step(rng.uniform(low, high))[2]
else:
    if which == "Meta-World":
        import metaworld
        env = gymnasium.make("Meta-World/MT1", env_name=task, seed=0)
    else:
        import gym_taskboard
        env = gymnasium.make(f"TaskBoard1-{task}-Assembly-v0")
    step = lambda: any(env.step(env.action_space.sample())[2:4])
env.reset()
step()
begun = time.process_time()
for _ in range(steps):
    if step():
        env.reset()
print(json.dumps(steps / (time.process_time() - begun)))
"""


def actions(rng: np.random.Generator, *shape: int) -> Any:
    """Small ones, that never open the hand."""
    small = rng.uniform(-SMALL, SMALL, (*shape, 7)).astype(np.float32)
    small[..., 6] = -1.0
    return small


def insert(scenario: str, **more: Any) -> float:
    """Steps of `APOInsert-v0` a second of one core; starts are made before."""
    env = gymnasium.make("APOInsert-v0", scenario=scenario, layouts=2, disable_env_checker=True, **more)
    rng = np.random.default_rng(0)
    for seed in range(4):
        env.reset(seed=seed)
    begun = time.process_time()
    for _ in range(STEPS):
        if env.step(actions(rng))[2]:
            env.reset()
    return STEPS / (time.process_time() - begun)


def replays() -> dict[str, float]:
    """Steps a second of the environments whose step is more than 50 ms."""
    found = {}
    for name, more in {"APOReplay-v0": {}, "APOTrack-v0": {"replay": False}}.items():
        env = gymnasium.make(name, scenario="stick_in_tower", disable_env_checker=True, **more)
        act = {"act": 0, "twist": np.zeros(6)} if name == "APOTrack-v0" else np.zeros(env.action_space.shape)
        env.reset(seed=0)
        steps, spent = 0, 0.0
        for seed in range(10):
            env.reset(seed=seed)
            begun = time.process_time()
            over = False
            while not over and steps < 3 * (seed + 1):
                *_, over, _, _ = env.step(act)
                steps += 1
            spent += time.process_time() - begun
        found[name] = steps / spent
    return found


def single(python: str | None) -> dict[str, float]:
    """Medians over rounds in which ours and theirs take turns."""
    ways: dict[str, Callable[[], float]] = {
        f"APOInsert-v0 {name}": lambda name=name: insert(name) for name in SCENARIOS
    }
    if python:
        ways |= {name: lambda name=name: _theirs(python, name) for name in TASKS}
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, way in ways.items():
            found[name].append(way())
            print(f"{name}: {found[name][-1]:.0f} steps/s", flush=True)
    return {name: statistics.median(each) for name, each in found.items()}


def _theirs(python: str, name: str) -> float:
    steps = str(100 if "taskboard" in name else STEPS)
    done = subprocess.run([python, "-c", PROGRAM, name, steps], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{name} did not run:\n{done.stderr[-1500:]}")
    return float(done.stdout.splitlines()[-1])


def vectors() -> list[dict[str, Any]]:
    """Steps of all environments a second, by the wall."""
    found = []
    for mode, count in (("sync", 1), ("sync", 2), ("sync", 4), ("async", 1), ("async", 2), ("async", 4)):
        rng = np.random.default_rng(0)
        made = gymnasium.make_vec(
            "APOInsert-v0", count, mode, scenario="stick_in_tower", layouts=2, vector_kwargs={}, horizon=STEPS
        )
        made.reset(seed=[0] * count)
        made.step(actions(rng, count))
        begun = time.perf_counter()
        for _ in range(STEPS // 2):
            made.step(actions(rng, count))
        found.append({"mode": mode, "count": count, "rate": count * (STEPS // 2) / (time.perf_counter() - begun)})
        made.close()
        print(found[-1], flush=True)
    return found


def memory(episodes: int) -> list[tuple[int, float]]:
    """Resident memory after so many episodes, [MB]."""
    env = gymnasium.make("APOInsert-v0", scenario="stick_in_tower", layouts=16, horizon=20)
    rng = np.random.default_rng(0)
    found = []
    for episode in range(episodes):
        env.reset(seed=episode)
        over = False
        while not over:
            over = env.step(actions(rng))[2]
        if (episode + 1) % (episodes // 5) == 0:
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            found.append((episode + 1, pages * resource.getpagesize() / 1e6))
            print(found[-1], flush=True)
    return found


def _page(found: dict[str, Any]) -> Iterator[str]:
    yield from ("# Control steps a second", "")
    yield "Written by `python -m benchmarks.throughput`, and as fast as one machine: compare within the tables only."
    if "single" in found:
        yield from ("", "## One environment, one core", "")
        yield f"Random actions, {STEPS} steps, medians of {ROUNDS} rounds in turn, by the time of the processor. A step"
        yield "of `APOInsert-v0` is 50 steps of 1 ms of a robot that drives, feels and gives way. Others run on MuJoCo"
        yield "3.8.1 (robosuite 1.5.2, Meta-World 3.0.0, gym-taskboard 0.1.0), as made by default, without pictures."
        yield from ("", "| environment | steps a second | Hz | times real time |", "|---|--:|--:|--:|")
        for name, rate in found["single"].items():
            hz = TASKS.get(name, OURS)
            yield f"| {name} | {rate:.0f} | {hz} | {rate / hz:.1f} |"
        yield ""
        told = ", ".join(f"`{name}` {rate:.1f}" for name, rate in found["replays"].items())
        yield f"Steps that are a whole replay, or an operation without physics, of `stick_in_tower`: {told} a second."
    if "vectors" in found:
        yield from ("", "## Vectors", "")
        yield f"`make_vec` of `APOInsert-v0`, `stick_in_tower`, by the wall, on {found['cores']} cores."
        yield from ("", "| mode | environments | steps a second of all | to one, sync |", "|---|--:|--:|--:|")
        one = found["vectors"][0]["rate"]
        for each in found["vectors"]:
            yield f"| {each['mode']} | {each['count']} | {each['rate']:.0f} | {each['rate'] / one:.2f} |"
        two = next(each["rate"] for each in found["vectors"] if (each["mode"], each["count"]) == ("async", 2))
        yield from ("", f"Two in processes of their own: on each core {two / one / 2:.0%} of what one makes alone.")
    if "memory" in found:
        yield from ("", "## Memory", "", "Resident, of one environment with 16 layouts, after so many episodes:", "")
        yield ", ".join(f"{count}: {mb:.0f} MB" for count, mb in found["memory"]) + "."


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--others", help="Python of an environment in which others run")
    asked.add_argument("--episodes", type=int, default=1000)
    asked.add_argument("--only", choices=("single", "replays", "vectors", "memory", "page"), action="append")
    given = asked.parse_args()
    parts: dict[str, Callable[[], Any]] = {
        "single": lambda: single(given.others),
        "replays": replays,
        "vectors": vectors,
        "memory": lambda: memory(given.episodes),
    }
    found = measured(parts, given.only, RESULT)
    PAGE.write_text(with_mujoco("\n".join(_page(found)) + "\n", [found["mujoco"]]), encoding="utf-8")


if __name__ == "__main__":
    main()
