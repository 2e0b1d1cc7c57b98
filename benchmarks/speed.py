"""Measure where the time of a trial goes, and compare checkouts: `python -m benchmarks.speed [--against ROOT ...]`.

Every checkout has a process of its own. The same trials run in all of them in turn, so that a busy machine slows all
alike; ratios are medians over trials. Stages exclude each other and sum to the whole, in processor time. Python of a
virtual environment with robosuite or gym-taskboard (`--others PYTHON`) adds their control steps. Writes
benchmarks/results/speed.json, docs/results/speed.md and its picture; `--only` measures one part again.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "speed.json"
PAGE = ROOT / "docs" / "results" / "speed.md"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table", "peg_in_hole")
FIDELITIES = ("near-contact", "full")
METHOD = "contact-robust"
STAGES = {
    "demonstration": ("demonstration_of", "simulate_demonstration", "record_demonstration"),
    "correction, fit": ("apply_method",),
    "prediction": ("predicted_outcome", "predict_success", "promised_success"),
    "replay": ("replay_and_judge",),
    "judge": ("judge",),
}
"""Functions of a stage, by their names in this and in earlier checkouts."""
PHYSICS = "replay: mj_step"
OTHER = "other"
ORDER = ("demonstration", "correction, fit", "prediction", PHYSICS, "replay", "judge", OTHER)
STEPS = 400
TASKS = {"robosuite Lift": 20, "gym-taskboard Pegs": 20}
"""Environments of other packages, and their actions in a second of simulated time."""
PROGRAM = """
import json, sys, time, warnings
warnings.filterwarnings("ignore")
import numpy as np
name, steps = sys.argv[1], int(sys.argv[2])
rng = np.random.default_rng(0)
if name == "robosuite Lift":
    import robosuite
    seen = dict(has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False)
    env = robosuite.make("Lift", robots="Panda", control_freq=20, hard_reset=False, **seen)
    low, high = env.action_spec
    step = lambda: env.step(rng.uniform(low, high))[2]
else:
    import gymnasium, gym_taskboard
    env = gymnasium.make("TaskBoard1-Pegs-Assembly-v0")
    step = lambda: any(env.step(env.action_space.sample())[2:4])
env.reset()
step()
begun = time.process_time()
for _ in range(steps):
    if step():
        env.reset()
print(json.dumps(steps / (time.process_time() - begun)))
"""


class Stages:
    """Processor time by stage: that of the innermost stage that has begun and not ended."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin again at zero."""
        self.spent = defaultdict[str, float](float)
        self._running = [OTHER]
        self._since = time.process_time()

    def switch(self, begin: str | None) -> None:
        """Begin a stage, or end the innermost one."""
        now = time.process_time()
        self.spent[self._running[-1]] += now - self._since
        self._since = now
        if begin is None:
            self._running.pop()
        else:
            self._running.append(begin)

    def timed(self, function: Callable[..., Any], stage: str, within: str | None = None) -> Callable[..., Any]:
        """Return a function that counts as a stage; within another stage alone, if one is named."""

        def call(*args: Any, **kwargs: Any) -> Any:
            if within is not None and self._running[-1] != within:
                return function(*args, **kwargs)
            self.switch(stage)
            try:
                return function(*args, **kwargs)
            finally:
                self.switch(None)

        call.stage = stage  # type: ignore[attr-defined]
        return call


def work() -> None:
    """Run the trials that stdin names, a JSON list each, in the checkout on PYTHONPATH; answer by stage on stdout."""
    import mujoco

    settings = import_module("apo_bench.records.settings")
    renamed = hasattr(settings, "TrialConfig")
    run = import_module("apo_bench.trial.run" if renamed else "apo_bench.trial.trial")
    configure = settings.TrialConfig if renamed else settings.TrialSettings
    stages = Stages()
    timed_step = stages.timed(mujoco.mj_step, PHYSICS, within="replay")
    replace(mujoco.mj_step, timed_step)
    mujoco.mj_step = timed_step
    own = [m for name, m in sys.modules.items() if name.startswith(("apo_bench.trial.", "apo_bench.judging"))]
    for stage, names in STAGES.items():
        for function in [vars(module)[name] for module in own for name in names if name in vars(module)]:
            if callable(function) and not hasattr(function, "stage"):
                replace(function, stages.timed(function, stage))
    scenes = dict[str, Any]()
    for line in sys.stdin:
        scenario, fidelity, seed = json.loads(line)
        known = {"fidelity": fidelity if renamed else fidelity.removeprefix("near-")}
        config = configure(scenario=scenario, method=METHOD, seed=seed, **known)
        if scenario not in scenes:
            scenes[scenario] = run.scene_of(config)
            run.run_trial(config, scenes[scenario])  # what only a first trial does is not measured
        stages.reset()
        record = run.run_trial(config, scenes[scenario])
        stages.switch(OTHER)
        simulated_s = record.get("sim_time_s", record.get("sim_seconds"))
        answer = {"stages": stages.spent, "simulated_s": simulated_s, "success": record["success"]}
        print(json.dumps(answer), flush=True)


def replace(function: Callable[..., Any], by: Callable[..., Any]) -> None:
    """Put a function in the place of another in every module of the package."""
    for name, module in list(sys.modules.items()):
        if name.startswith("apo_bench"):
            for key in [key for key, value in vars(module).items() if value is function]:
                setattr(module, key, by)


def trials(roots: Sequence[Path], seeds: int) -> list[dict[str, Any]]:
    """Return every trial of every checkout: in turn, each seed in all of them before the next."""
    command = [sys.executable, "-P", str(Path(__file__).resolve()), "--work"]
    piped = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    workers = [subprocess.Popen(command, env=os.environ | {"PYTHONPATH": str(root)}, **piped) for root in roots]
    found = []
    try:
        for scenario in SCENARIOS:
            for fidelity in FIDELITIES:
                for seed in range(seeds):
                    for i, worker in enumerate(workers):
                        worker.stdin.write(json.dumps([scenario, fidelity, seed]) + "\n")
                        worker.stdin.flush()
                        answer = worker.stdout.readline()
                        if not answer:
                            raise SystemExit(f"{roots[i]} ended in {scenario}, {fidelity}, seed {seed}")
                        given = {"checkout": i, "scenario": scenario, "fidelity": fidelity, "seed": seed}
                        found.append(given | json.loads(answer))
                print(f"{scenario}, {fidelity}: {seeds} trials of {len(roots)} checkouts", flush=True)
    finally:
        for worker in workers:
            worker.stdin.close()
            worker.wait()
    return found


def chosen(made: Sequence[dict[str, Any]], **which: Any) -> list[dict[str, Any]]:
    """Return the trials with these values."""
    return [trial for trial in made if all(trial[key] == value for key, value in which.items())]


def whole(trial: dict[str, Any]) -> float:
    """Return the processor time of a trial, [s]."""
    return sum(trial["stages"].values())


def ratios(made: Sequence[dict[str, Any]], other: int) -> Iterator[str]:
    """Yield a table: medians over seeds of this checkout's time over another's, and of the stages of all trials."""
    yield from ("| scenario | fidelity | ratio | seconds here | there |", "|---|---|--:|--:|--:|")
    for fidelity in FIDELITIES:
        for scenario in SCENARIOS:
            where = {"scenario": scenario, "fidelity": fidelity}
            here, there = ([whole(t) for t in chosen(made, checkout=i, **where)] for i in (0, other))
            ratio = median(a / b for a, b in zip(here, there, strict=True))
            yield f"| {scenario} | {fidelity} | {ratio:.2f} | {median(here):.2f} | {median(there):.2f} |"
        here, there = (chosen(made, checkout=i, fidelity=fidelity) for i in (0, other))
        ratio = median(whole(a) / whole(b) for a, b in zip(here, there, strict=True))
        yield f"| all | {fidelity} | {ratio:.2f} | {mean(here):.2f} | {mean(there):.2f} |"
        for stage in ORDER:
            yield f"| all: {stage} | {fidelity} | | {mean(here, stage):.3f} | {mean(there, stage):.3f} |"


def mean(some: Sequence[dict[str, Any]], stage: str | None = None) -> float:
    """Return the mean processor time of trials, or of one stage of them, [s]."""
    return sum(whole(t) if stage is None else t["stages"].get(stage, 0.0) for t in some) / len(some)


def steps(python: str | None) -> dict[str, float]:
    """Return control steps in a second of one core under random actions, medians of three rounds in turn."""
    ways: dict[str, Callable[[], float]] = {f"APOInsert-v0 {name}": partial(insert, name) for name in SCENARIOS}
    if python:
        ways |= {name: partial(steps_of_others, python, name) for name in TASKS}
    found = defaultdict[str, list[float]](list)
    for _ in range(3):
        for name, way in ways.items():
            found[name].append(way())
    return {name: median(each) for name, each in found.items() if all(each)}


def insert(scenario: str) -> float:
    """Return the steps of `APOInsert-v0` in a second of one core; starts are made before."""
    import gymnasium
    import numpy as np

    import apo_bench  # noqa: F401  # registers the environments

    env = gymnasium.make("APOInsert-v0", scenario=scenario, disable_env_checker=True)
    rng = np.random.default_rng(0)
    for seed in range(4):
        env.reset(seed=seed)
    begun = time.process_time()
    for k in range(STEPS):
        action = rng.uniform(-0.2, 0.2, 6).astype(np.float32)  # harder pushes end an episode early
        if any(env.step(action)[2:4]):
            env.reset(seed=k % 4)
    return STEPS / (time.process_time() - begun)


def steps_of_others(python: str, name: str) -> float:
    """Return the steps in a second of another package's environment; 0 if it does not run."""
    count = str(100 if "taskboard" in name else STEPS)
    done = subprocess.run([python, "-c", PROGRAM, name, count], capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{name} did not run: {done.stderr[-300:]}", flush=True)
        return 0.0
    return float(done.stdout.splitlines()[-1])


def draw(made: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the mean seconds of each stage as stacked bars."""
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot

    pyplot.rcParams["svg.hashsalt"] = "speed"
    figure, axes = pyplot.subplots(figsize=(8, 3.6), layout="constrained")
    bars = [(scenario, fidelity) for scenario in reversed(SCENARIOS) for fidelity in reversed(FIDELITIES)]
    left = [0.0] * len(bars)
    for stage in ORDER:
        seconds = [mean(chosen(made, checkout=0, scenario=s, fidelity=f), stage) for s, f in bars]
        axes.barh([f"{s}, {f}" for s, f in bars], seconds, left=left, label=stage)
        left = [a + b for a, b in zip(left, seconds, strict=True)]
    axes.set_xlabel("processor seconds of a trial")
    axes.legend(fontsize="small")
    figure.savefig(path, metadata={"Date": None})


def page(found: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the page."""
    made = found["trials"]
    yield from ("# Speed", "")
    yield "Repeat it with `python -m benchmarks.speed`. Numbers depend on the machine: compare within a table only."
    yield from ("", "## Trial", "")
    yield f"Mean processor seconds of a trial of `{METHOD}` at 1 mm, 1 degree (1 sigma per axis), by stage."
    yield ""
    yield "![Stages of a trial](speed.svg)"
    yield ""
    yield from ("| scenario | fidelity | seconds | times real time |", "|---|---|--:|--:|")
    for scenario in SCENARIOS:
        for fidelity in FIDELITIES:
            some = chosen(made, checkout=0, scenario=scenario, fidelity=fidelity)
            factors = [t["simulated_s"] / whole(t) for t in some if t["simulated_s"]]
            yield f"| {scenario} | {fidelity} | {mean(some):.2f} | {median(factors):.0f} |"
    yield ""
    yield "`near-contact` skips stretches far from contact; their simulated time counts."
    yield from ("", "## Control steps", "")
    yield "Steps a second of one core under random actions, without pictures; other packages on MuJoCo 3.8.1."
    yield ""
    yield from ("| environment | steps a second | Hz | times real time |", "|---|--:|--:|--:|")
    for name, rate in found["steps"].items():
        hz = TASKS.get(name, 20)
        yield f"| {name} | {rate:.0f} | {hz} | {rate / hz:.1f} |"
    if missing := [name for name in TASKS if name not in found["steps"]]:
        yield ""
        yield f"Not measured, since they did not install or run: {', '.join(missing)}."
    yield from ("", "## Correctors", "")
    yield from found["correctors"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, nargs="*", default=[], help="other checkouts, timed in turn")
    parser.add_argument("--seeds", type=int, default=5, help="trials of each scenario and fidelity (5)")
    parser.add_argument("--others", help="Python of a virtual environment with robosuite and gym-taskboard")
    parser.add_argument("--only", choices=("trials", "steps", "correctors", "page"), help="measure one part again")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work()
        return
    from benchmarks.corrector import table_of_correctors

    parts: dict[str, Callable[[], Any]] = {
        "trials": lambda: trials([ROOT, *given.against], given.seeds),
        "steps": lambda: steps(given.others),
        "correctors": table_of_correctors,
    }
    found: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8")) if RESULT.exists() else {}
    for name in (given.only,) if given.only else parts:
        if name in parts:
            made = parts[name]()
            if name == "trials":
                for i, root in enumerate(given.against, start=1):
                    print(f"\nThis checkout over {root}:", *ratios(made, i), sep="\n", flush=True)
                made = chosen(made, checkout=0)
            found[name] = made
            RESULT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if {"trials", "steps", "correctors"} <= found.keys():
        import mujoco

        from benchmarks.provenance import with_mujoco

        draw(found["trials"], PAGE.with_suffix(".svg"))
        PAGE.write_text(with_mujoco("\n".join(page(found)), [mujoco.__version__]), encoding="utf-8")


if __name__ == "__main__":
    main()
