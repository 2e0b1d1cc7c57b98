"""What each act of a robot that feels is worth: `python -m benchmarks.feel_acts --trials N --out FILE`.

Trials of benchmarks/robot_errors.toml with all of its robot's errors together: with all acts, with each of them left
out, and with all acts and half the time step. Seeds are the same everywhere. A trial is a line of FILE, and what is
there is not run again. `--table` prints the table of FILE only; `python benchmarks/robot_errors.py FOLDER --acts FILE`
puts it on docs/results/robot-errors.md.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from functools import cache, lru_cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import json
import tomllib

import mujoco

from apo_bench.benchmark.analysis import wilson
from apo_bench.errors import InputError
from apo_bench.records import TrialConfig, parse_method
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.probing.config import PROBING_ACTIONS
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.stages import (
    WRENCH,
    SimulatedDemonstration,
    draw_robot_error,
    observe_demonstration,
    replay_and_judge,
    scene_of,
    simulate_demonstration,
    stream_key,
    trial_outcome,
)
from apo_bench.trial.trial import noise_of, probing_config

SWEEP = Path(__file__).with_name("robot_errors.toml")
METHODS = ("contact+probe", "oracle+probe")
ALL = "all"
HALF_STEP = "half-step"
VARIANTS = (ALL, *PROBING_ACTIONS, HALF_STEP)
"""All acts, all but the one that is named, and all with half the time step."""
Line = dict[str, Any]


class Case(NamedTuple):
    """One trial; these fields of a line tell which."""

    scenario: str
    method: str
    variant: str
    seed: int


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--trials", type=int, default=20, help="seeds from 0")
    asked.add_argument("--out", type=Path, required=True, metavar="FILE", help="lines of JSON, one a trial")
    asked.add_argument("--workers", type=int, default=1)
    asked.add_argument("--scenarios", nargs="+", default=sweep()["scenarios"])
    asked.add_argument("--method", nargs="+", default=METHODS, help="each with +probe")
    asked.add_argument("--variants", nargs="+", default=VARIANTS, choices=VARIANTS, help="an act: it is left out")
    asked.add_argument("--table", action="store_true", help="run nothing, print the table of FILE")
    given = asked.parse_args()
    if given.table:
        print(table(lines_of(given.out)))
        return
    if plain := [method for method in given.method if not parse_method(method).probe]:
        asked.error(f"--method {plain[0]} was given, which does not feel; write {parse_method(plain[0]).plan}+probe.")
    todo = missing(given.trials, given.scenarios, given.method, given.variants, lines_of(given.out))
    try:
        for case in todo:
            settings_of(case)
    except InputError as error:
        asked.error(str(error))
    given.out.parent.mkdir(parents=True, exist_ok=True)
    with given.out.open("a", encoding="utf-8") as file, ProcessPoolExecutor(given.workers) as pool:
        if given.out.stat().st_size and not given.out.read_bytes().endswith(b"\n"):
            file.write("\n")
        for done in as_completed([pool.submit(trial, case) for case in todo]):
            line = done.result()
            file.write(json.dumps(line) + "\n")
            file.flush()
            print(*(line[key] for key in (*Case._fields, "success", "code")), flush=True)
    print(table(lines_of(given.out)))


@cache
def sweep() -> dict[str, Any]:
    """What benchmarks/robot_errors.toml says."""
    return tomllib.loads(SWEEP.read_text(encoding="utf-8"))


def together() -> str:
    """All errors of the robot at once."""
    return max(sweep()["robot_error"], key=lambda name: name.count("+"))


def lines_of(path: Path) -> list[Line]:
    """The trials that are there; half a line of a run that was stopped is none."""
    lines = []
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            lines.append(json.loads(text))
        except json.JSONDecodeError:
            continue
    return lines


def missing(
    trials: int, scenarios: Sequence[str], methods: Sequence[str], variants: Sequence[str], known: Iterable[Line]
) -> list[Case]:
    """What is to be run, seed by seed, so that every cell has as many."""
    there = {case_of(line) for line in known}
    every = (Case(*at, seed) for seed in range(trials) for at in product(scenarios, methods, variants))
    return [case for case in every if case not in there]


def case_of(line: Line) -> Case:
    return Case(*(line[field] for field in Case._fields))


def settings_of(case: Case) -> TrialConfig:
    """A trial of the sweep, but for the acts: level 1, a careful human."""
    usual = TrialConfig(
        case.scenario,
        clearance_mm=load_scenario(case.scenario).clearance_mm,
        human_error_scale=0.0,
        method=case.method,
        seed=case.seed,
        robot_error=together(),
        fidelity="near-contact",
    )
    return replace(usual, timestep_s=usual.timestep_s / 2) if case.variant == HALF_STEP else usual


def acts_of(variant: str) -> tuple[str, ...]:
    return tuple(act for act in PROBING_ACTIONS if act != variant)


def trial(case: Case) -> Line:
    """Run one: the same as `run_trial`, but that an act may be left out."""
    settings = settings_of(case)
    scene, simulated = _demonstrated(replace(settings, method=METHODS[0]))
    first: Line = case._asdict() | {
        "robot_error": settings.robot_error,
        "timestep_s": settings.timestep_s,
        "mujoco": mujoco.__version__,
    }
    if simulated.demonstration.code != "ok":
        return first | {"success": None, "code": simulated.demonstration.code}
    truth = simulated.layout.poses
    seen = observe_demonstration(simulated, noise_of(settings, scene, simulated), case.seed)
    planned = apply_method(parse_method(case.method).plan, seen, truth, where=scene)
    if planned.plan is None:
        assert planned.failure is not None
        return first | {"success": False, "code": planned.failure.code, "sentence": planned.failure.sentence}
    error = draw_robot_error(settings.robot_error, scene, case.seed)
    key = stream_key(case.seed, WRENCH)
    probing = probing_config(planned.plan, scene, settings.robot_error, key, settings.ft_sensor, acts_of(case.variant))
    config = ExecutionConfig(settings.fidelity, robot_error=error, probing=probing)
    attempt = replay_and_judge(planned.plan, scene, truth, config=config)
    outcome = trial_outcome(attempt)
    felt = attempt.result.felt
    return first | {
        "success": attempt.verdict.success,
        "code": outcome.code,
        "sentence": outcome.sentence,
        "sim_time_s": attempt.result.sim_time_s,
        "probe_contacts": None if felt is None else felt.touches,
    }


@lru_cache(maxsize=8)
def _demonstrated(settings: TrialConfig) -> tuple[Scene, SimulatedDemonstration]:
    scene = _scene(settings.scenario, settings.clearance_mm, settings.timestep_s)
    return scene, simulate_demonstration(scene, settings.human_error_scale, settings.seed)


@cache
def _scene(scenario: str, clearance_mm: float, timestep_s: float) -> Scene:
    return scene_of(TrialConfig(scenario, clearance_mm=clearance_mm, timestep_s=timestep_s))


def table(lines: Sequence[Line]) -> str:
    """Successes of each variant, method and scenario, all scenarios with Wilson's interval, and pairs that differ."""
    scenarios = list(dict.fromkeys(line["scenario"] for line in lines))
    heads = ["method", "without", *scenarios, "all scenarios", "lost, won"]
    rows = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    rows += [f"| {' | '.join(cells)} |" for cells in _cells(lines, scenarios)]
    return "\n".join(rows) + "\n"


def _cells(lines: Sequence[Line], scenarios: Sequence[str]) -> Iterator[list[str]]:
    won = {case_of(line): line["success"] for line in lines if line["success"] is not None}
    names = {ALL: "nothing", HALF_STEP: "nothing, half the time step"}
    for method in dict.fromkeys(case.method for case in won):
        for variant in VARIANTS:
            those = {case: right for case, right in won.items() if (case.method, case.variant) == (method, variant)}
            if not those:
                continue
            each = [[right for case, right in those.items() if case.scenario == name] for name in scenarios]
            low, high = wilson(sum(those.values()), len(those))
            pooled = f"{sum(those.values())} of {len(those)} ({100 * low:.0f} to {100 * high:.0f} %)"
            both = [(won[all_of], right) for c, right in those.items() if (all_of := c._replace(variant=ALL)) in won]
            differ = f"{both.count((True, False))}, {both.count((False, True))}"
            counts = [f"{sum(right)} of {len(right)}" for right in each]
            said = names.get(variant, f"`{variant}`")
            yield [f"`{method}`", said, *counts, pooled, "" if variant == ALL else differ]


if __name__ == "__main__":
    main()
