"""Does the time step decide verdicts? `python benchmarks/timestep.py [WORKERS [SEEDS]]` (34 seeds: some 20 minutes).

The same trials, replayed as seen by a careful human at levels near the border of the clearance, with 1 ms and with
0.5 ms steps; prints how many verdicts differ and writes `benchmarks/results/timestep.json`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

from apo_bench.records import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.trial import run_trial

SCENARIOS = ("stick_in_tower", "stick_on_castles")
LEVELS = (0.05, 0.1, 0.2)
STEPS = (0.001, 0.0005)
RESULT = Path(__file__).parent / "results" / "timestep.json"


class Case(NamedTuple):
    scenario: str
    level: float
    seed: int


@cache
def scene(scenario: str, step: float) -> Scene:
    return build_scene(load_scenario(scenario), timestep_s=step)


def verdicts(case: Case) -> list[bool]:
    """Strict success with each step."""
    return [bool(run_trial(_spec(case, step), scene(case.scenario, step))["success"]) for step in STEPS]


def _spec(case: Case, step: float) -> TrialSettings:
    level = {"level_mm": case.level, "level_deg": case.level}
    return TrialSettings(scenario=case.scenario, seed=case.seed, careless=0.0, method="none", timestep_s=step, **level)


def main(workers: int = 2, seeds: int = 34) -> None:
    cases = [Case(*values) for values in product(SCENARIOS, LEVELS, range(seeds))]
    with ProcessPoolExecutor(workers) as pool:
        pairs = list(pool.map(verdicts, cases, chunksize=3))
    lines = []
    for scenario, level in product(SCENARIOS, LEVELS):
        mine = [pair for case, pair in zip(cases, pairs, strict=True) if case[:2] == (scenario, level)]
        won, half = (sum(pair[i] for pair in mine) for i in (0, 1))
        differ = sum(a != b for a, b in mine)
        lines.append(
            {"scenario": scenario, "level": level, "n": len(mine), "1 ms": won, "0.5 ms": half, "differ": differ}
        )
        print(lines[-1])
    differ = sum(line["differ"] for line in lines)
    print(f"{differ} of {len(pairs)} verdicts differ ({differ / len(pairs):.1%})")
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(
        json.dumps({"command": f"python benchmarks/timestep.py {workers} {seeds}", "cells": lines}, indent=1) + "\n"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
