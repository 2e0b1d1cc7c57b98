"""What the baselines are set to: `python benchmarks/tune.py [SEEDS]` (6 seeds: some 10 minutes of a free core).

Every baseline replays two scenes, with a careless human, at levels 1 and 2, once for each point of a grid; seeds count
from 100,000, where no table of results takes any. The point with the most strict successes is chosen; of those whose
goals are then equally near to the truth, to 0.1 mm, the one that leaves the smallest gap. Prints the table and writes
`benchmarks/results/tuning.json`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import math
import sys
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

from apo_bench.assembly import Plan
from apo_bench.correction.baselines.penalty import least_squares, penalty
from apo_bench.correction.baselines.snap import snap
from apo_bench.correction.correctors import correct
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.simulation.scene.settling import settle
from apo_bench.trial.outcome_columns import goal_errors
from apo_bench.trial.stages import (
    SimulatedDemonstration,
    observe_demonstration,
    replay_and_judge,
    simulate_demonstration,
)

SCENARIOS = ("stick_in_tower", "vanished_fixture")
LEVELS = (1.0, 2.0)
CARELESS = 1.0
FIRST_SEED = 100_000
GRIDS: Mapping[str, tuple[Callable[..., Any], Mapping[str, tuple[float, ...]]]] = {
    "least-squares": (least_squares, {"contact_m": (1e-3, 3e-4, 1e-4, 1e-5, 1e-6)}),
    "penalty": (penalty, {"contact_m": (3e-4, 1e-4, 3e-5), "length": (0.05, 0.1, 0.2)}),
    "settle": (settle, {"lift_m": (0.0, 1e-3, 3e-3)}),
    "snap": (snap, {}),
}
"""Corrector -> its settings and their values, [m], a length of `penalty` in standard deviations; `snap` has none."""
RESULT = Path(__file__).parent / "results" / "tuning.json"


Values = tuple[float, ...]


class Case(NamedTuple):
    """A cell of the table."""

    scenario: str
    level: float
    method: str
    values: Values


class Replayed(NamedTuple):
    """One replay."""

    success: bool
    gap_mm: float
    fixed_mm: float
    """Mean error of the corrected goals along what contacts fix."""
    free_mm: float


def main(seeds: int = 6) -> None:
    cells: dict[Case, list[Replayed]] = {}
    for name in SCENARIOS:
        scene = build_scene(load_scenario(name))
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            shown = simulate_demonstration(scene, CARELESS, seed)
            for level, method in product(LEVELS, GRIDS):
                for values in product(*GRIDS[method][1].values()):
                    replayed = _replayed(scene, shown, level, seed, _corrector(method, values))
                    cells.setdefault(Case(name, level, method, values), []).append(replayed)
    lines = [_line(case, replays) for case, replays in cells.items()]
    chosen = {method: _best(method, lines) for method in GRIDS}
    for line in (*lines, chosen):
        print(line)
    command = f"python benchmarks/tune.py {seeds}"
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(json.dumps({"command": command, "chosen": chosen, "cells": lines}, indent=1) + "\n")


def _settings(method: str, values: Values) -> dict[str, float]:
    return dict(zip(GRIDS[method][1], values, strict=True))


def _corrector(method: str, values: Values) -> Callable[..., Any]:
    return partial(GRIDS[method][0], **_settings(method, values))


def _replayed(
    scene: Scene, shown: SimulatedDemonstration, level: float, seed: int, corrector: Callable[..., Any]
) -> Replayed:
    seen = observe_demonstration(shown, make_noise("isotropic", Level(level, level)), seed)
    truth = shown.layout.goals
    made = correct(seen, corrector)
    fixed_mm, free_mm = goal_errors(seen.assembly, seen.start, truth, made.goals)
    won = made.ok and replay_and_judge(Plan(seen.assembly, seen.start, made.goals), scene, truth).verdict.success
    return Replayed(bool(won), made.gap_after_m * 1e3, fixed_mm, free_mm)


def _line(case: Case, replays: list[Replayed]) -> dict[str, Any]:
    return {
        "scenario": case.scenario,
        "level": case.level,
        "method": case.method,
        **_settings(case.method, case.values),
        "n": len(replays),
        "won": sum(replay.success for replay in replays),
        "gap_mm": round(mean(replay.gap_mm for replay in replays), 4),
        "fixed_mm": round(mean(replay.fixed_mm for replay in replays), 3),
        "free_mm": round(mean(replay.free_mm for replay in replays), 3),
    }


def _best(method: str, lines: list[dict[str, Any]]) -> dict[str, float]:
    def worth(settings: dict[str, float]) -> tuple[int, float, float]:
        mine = [line for line in lines if line["method"] == method and settings.items() <= line.items()]
        error_mm = mean(math.hypot(line["fixed_mm"], line["free_mm"]) for line in mine)
        return sum(line["won"] for line in mine), -round(error_mm, 1), -mean(line["gap_mm"] for line in mine)

    return max((_settings(method, values) for values in product(*GRIDS[method][1].values())), key=worth)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
