"""Measure control steps a second of the environments: `python -m benchmarks.throughput --others PYTHON`.

Steps of one core in processor time, under random actions; vectors of `APOInsert-v0` by the clock, on an idle machine;
memory over many episodes. PYTHON belongs to a virtual environment with the other packages (`pip install mujoco==3.8.1
robosuite metaworld gym-taskboard`); rounds of theirs and ours take turns. Writes results/throughput.json and
docs/results/throughput.md; `--only` measures parts of it again and keeps the rest.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

import apo_bench  # noqa: F401  # registers the environments
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "throughput.json"
PAGE = ROOT / "docs" / "results" / "throughput.md"
SCENARIOS = ("dovetail", "stick_in_tower", "pocket_table", "gearbox", "peg_in_hole")
OURS_HZ = 20  # actions in a second of simulated time
STEPS = 400
ROUNDS = 3
SMALL = 0.2  # largest action: a harder push ends its episode early
TASKS = {
    "robosuite Lift": 20,
    "robosuite NutAssemblySquare": 20,
    "robosuite TwoArmPegInHole": 20,
    "Meta-World peg-insert-side-v3": 80,
    "gym-taskboard Pegs": 20,
}
"""Environments of other packages, and their actions in a second of simulated time."""
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
    """Draw small actions that never open the hand."""
    small = rng.uniform(-SMALL, SMALL, (*shape, 7)).astype(np.float32)
    small[..., 6] = -1.0
    return small


def insert(scenario: str, **more: Any) -> float:
    """Return the steps of `APOInsert-v0` in a second of one core; starts are made before."""
    env = gymnasium.make("APOInsert-v0", scenario=scenario, layouts=2, disable_env_checker=True, **more)
    rng = np.random.default_rng(0)
    for seed in range(4):
        env.reset(seed=seed)
    begun = time.process_time()
    for _ in range(STEPS):
        if any(env.step(actions(rng))[2:4]):
            env.reset()
    return STEPS / (time.process_time() - begun)


def replays() -> dict[str, float]:
    """Return the steps in a second of the environments whose step is more than 50 ms."""
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
                _, _, terminated, truncated, _ = env.step(act)
                over = terminated or truncated
                steps += 1
            spent += time.process_time() - begun
        found[name] = steps / spent
    return found


def single(python: str | None) -> dict[str, float]:
    """Return medians over rounds in which ours and theirs take turns."""
    ways: dict[str, Callable[[], float]] = {f"APOInsert-v0 {name}": partial(insert, name) for name in SCENARIOS}
    if python:
        ways |= {name: partial(_theirs, python, name) for name in TASKS}
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
    """Return the steps of all environments in a second, by the clock."""
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
    """Return counts of episodes and the resident memory after them, [MB]."""
    env = gymnasium.make("APOInsert-v0", scenario="stick_in_tower", layouts=16, horizon=20)
    rng = np.random.default_rng(0)
    found = []
    for episode in range(episodes):
        env.reset(seed=episode)
        over = False
        while not over:
            over = any(env.step(actions(rng))[2:4])
        if (episode + 1) % (episodes // 5) == 0:
            pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
            found.append((episode + 1, pages * resource.getpagesize() / 1e6))
            print(found[-1], flush=True)
    return found


def _page(found: dict[str, Any]) -> Iterator[str]:
    yield from ("# Control steps a second", "")
    yield "Written by `python -m benchmarks.throughput` on one machine: compare within the tables only."
    if "single" in found:
        yield from ("", "## One environment, one core", "")
        yield f"Random actions, {STEPS} steps, medians of {ROUNDS} rounds in turn, in processor time. A step"
        yield "of `APOInsert-v0` is 50 steps of 1 ms of a compliant robot with a force sensor. Others run on MuJoCo"
        yield "3.8.1 (robosuite 1.5.2, Meta-World 3.0.0, gym-taskboard 0.1.0), as made by default, without pictures."
        yield from ("", "| environment | steps a second | Hz | times real time |", "|---|--:|--:|--:|")
        for name, rate in found["single"].items():
            hz = TASKS.get(name, OURS_HZ)
            yield f"| {name} | {rate:.0f} | {hz} | {rate / hz:.1f} |"
        yield ""
        told = ", ".join(f"`{name}` {rate:.1f}" for name, rate in found["replays"].items())
        yield f"Steps that are a whole replay, or an operation without physics, of `stick_in_tower`: {told} a second."
    if "vectors" in found:
        yield from ("", "## Vectors", "")
        yield f"`make_vec` of `APOInsert-v0`, `stick_in_tower`, by the clock, on {found['cores']} cores."
        yield from ("", "| mode | environments | steps a second of all | to one, sync |", "|---|--:|--:|--:|")
        one = found["vectors"][0]["rate"]
        for each in found["vectors"]:
            yield f"| {each['mode']} | {each['count']} | {each['rate']:.0f} | {each['rate'] / one:.2f} |"
        two = next(each["rate"] for each in found["vectors"] if (each["mode"], each["count"]) == ("async", 2))
        yield from ("", f"Two processes: each core makes {two / one / 2:.0%} of the steps of one alone.")
    if "memory" in found:
        yield from (
            "",
            "## Memory",
            "",
            "Resident memory of one environment with 16 layouts, by the number of episodes:",
            "",
        )
        yield ", ".join(f"{count}: {mb:.0f} MB" for count, mb in found["memory"]) + "."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--others", help="Python of a virtual environment with the other packages")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--only", choices=("single", "replays", "vectors", "memory", "page"), action="append")
    given = parser.parse_args()
    parts: dict[str, Callable[[], Any]] = {
        "single": lambda: single(given.others),
        "replays": replays,
        "vectors": vectors,
        "memory": lambda: memory(given.episodes),
    }
    found: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8")) if RESULT.exists() else {}
    for name in given.only or parts:
        if name in parts:
            found[name] = parts[name]()
            found |= {"cores": os.cpu_count(), "machine": platform.platform(), "mujoco": mujoco.__version__}
            RESULT.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    PAGE.write_text(with_mujoco("\n".join(_page(found)) + "\n", [found["mujoco"]]), encoding="utf-8")


if __name__ == "__main__":
    main()
