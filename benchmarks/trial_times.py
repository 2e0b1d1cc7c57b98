"""What a trial takes, at a commit and today, in turn: `python benchmarks/trial_times.py COMMIT` (ten minutes, a core).

The four examples of the paper, methods `uncorrected`, `paper` and `contact` at level 1 with careless humans: each trial with
its demonstration, from settings to row, as `run_trial` makes it from a scene that is compiled. Each of the two packages
runs in a process of its own, and the same trial is run by one and then by the other, so that a machine whose speed
drifts treats both alike. Writes results/trial_times.json, which `python benchmarks/profiling.py` puts on its page.
With `--scenarios` others are timed at fidelity `near-contact`, each by itself, with the time that its scene takes to be
built, and are kept beside those.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import IO, Any

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "trial_times.json"
SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
METHODS = ("uncorrected", "paper", "contact")
FIDELITIES = ("full", "contact")

Told = Mapping[str, Any]


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("commit", nargs="?", help="the commit to compare with, such as 7a4d1df")
    asked.add_argument("--seeds", type=int, default=5, help="seeds of each kind of trial")
    asked.add_argument("--scenarios", nargs="+", help="time these, at fidelity near-contact, each by itself")
    asked.add_argument("--serve", action="store_true", help="run the trials that standard input asks for")
    given = asked.parse_args()
    if given.serve:
        return serve(sys.stdin, sys.stdout)
    if given.commit is None:
        asked.error("name a commit to compare with, such as 7a4d1df.")
    scenarios = given.scenarios or SCENARIOS
    fidelities = ("contact",) if given.scenarios else FIDELITIES
    began = os.getloadavg()[0]
    trials = [told for seed in range(given.seeds) for told in cases(seed, scenarios, fidelities)]
    with tree_of(given.commit) as before, server(before) as old, server(ROOT) as new:
        pairs = [both(old, new, told, i % 2 == 1) for i, told in enumerate(trials)]
    by, names = ("scenario", scenarios) if given.scenarios else ("fidelity", fidelities)
    asked_for = f" --scenarios {' '.join(scenarios)}" if given.scenarios else ""
    measured = {
        "command": f"python benchmarks/trial_times.py {given.commit} --seeds {given.seeds}{asked_for}",
        "before": commit(given.commit),
        "after": commit("HEAD"),
        "cores": os.cpu_count(),
        "load": [began, os.getloadavg()[0]],
        by: {name: summary(trials, pairs, by, name) for name in names},
    }
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    kept["scenarios" if given.scenarios else "fidelities"] = measured
    KEPT.write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")
    print(json.dumps(measured, indent=2))


def cases(seed: int, scenarios: Sequence[str], fidelities: Sequence[str]) -> Iterator[Told]:
    for scenario, method, fidelity in product(scenarios, METHODS, fidelities):
        yield {
            "scenario": scenario,
            "noise_mm": 1.0,
            "noise_deg": 1.0,
            "human_error_scale": 1.0,
            "seed": seed,
            "method": method,
            "fidelity": fidelity,
        }


def both(old: Any, new: Any, told: Told, swapped: bool) -> tuple[Told, Told]:
    """What the two packages say of one trial; which of them is asked first changes from trial to trial."""
    answers = {id(one): ask(one, told) for one in ((new, old) if swapped else (old, new))}
    return answers[id(old)], answers[id(new)]


def ask(process: Any, told: Told) -> Told:
    process.stdin.write(json.dumps(told) + "\n")
    process.stdin.flush()
    line = process.stdout.readline()
    if not line:
        raise SystemExit("a process that runs trials ended early; its message is above.")
    answer: Told = json.loads(line)
    return answer


def serve(asked: IO[str], answers: IO[str]) -> None:
    """Run one trial after the other; what is imported and compiled is at hand from the second of a scenario on."""
    from apo_bench.records import TrialConfig
    from apo_bench.scenario.file import load_scenario
    from apo_bench.simulation.scene.scene import build_scene
    from apo_bench.trial.run import run_trial

    scenes: dict[str, Any] = {}
    building: dict[str, float] = {}
    for line in asked:
        settings = TrialConfig(**json.loads(line))
        name = str(settings.scenario)
        if name not in scenes:
            scenario = load_scenario(name)
            began = time.process_time()
            scenes[name] = build_scene(scenario)
            building[name] = time.process_time() - began
            # what is compiled at the first trial of a method is at hand for all scenes
            for method in (settings.method,) if len(scenes) > 1 else METHODS:
                run_trial(replace(settings, method=method), scenes[name])
        began = time.perf_counter()
        worked = time.process_time()
        row = run_trial(settings, scenes[name])
        said = {
            "wall_s": time.perf_counter() - began,
            "cpu_s": time.process_time() - worked,
            "sim_s": row["sim_time_s"],
            "scene_s": building[name],
            "verdict": [row["success"], row["as_demonstrated"]],
        }
        answers.write(json.dumps(said) + "\n")
        answers.flush()


def summary(trials: list[Told], pairs: list[tuple[Told, Told]], by: str, which: str) -> dict[str, Any]:
    """Of the trials of one fidelity, or of one scenario."""
    mine = [pair for told, pair in zip(trials, pairs, strict=True) if told[by] == which]
    return {
        "trials": len(mine),
        **{
            key: [round(statistics.median(pair[i][key] for pair in mine), 3) for i in (0, 1)]
            for key in ("wall_s", "cpu_s", "scene_s")
        },
        "wall_ratio": round(statistics.median(new["wall_s"] / old["wall_s"] for old, new in mine), 3),
        "cpu_ratio": round(statistics.median(new["cpu_s"] / old["cpu_s"] for old, new in mine), 3),
        "real_time_factor": [factor([pair[i] for pair in mine], "wall_s") for i in (0, 1)],
        "cpu_real_time_factor": [factor([pair[i] for pair in mine], "cpu_s") for i in (0, 1)],
        "verdicts_differ": sum(old["verdict"] != new["verdict"] for old, new in mine),
    }


def factor(answers: list[Told], seconds: str) -> float | None:
    """How much faster than real time trials are in the median; None if none of them came to a replay."""
    factors = [told["sim_s"] / told[seconds] for told in answers if told["sim_s"] is not None]
    return round(statistics.median(factors), 1) if factors else None


@contextmanager
def tree_of(name: str) -> Iterator[Path]:
    """The files of a commit, in a folder for a while."""
    with tempfile.TemporaryDirectory() as folder:
        packed = subprocess.run(["git", "archive", name], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=packed, check=True)
        yield Path(folder)


@contextmanager
def server(tree: Path) -> Iterator[Any]:
    """A process with the package of a folder."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, str(Path(__file__).resolve()), "--serve"]
    process = subprocess.Popen(
        command, cwd=tree, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def commit(name: str) -> str:
    said = subprocess.run(["git", "rev-parse", "--short", name], cwd=ROOT, check=True, capture_output=True, text=True)
    return said.stdout.strip()


if __name__ == "__main__":
    main()
