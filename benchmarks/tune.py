"""What the baselines are set to: `python benchmarks/tune.py [SEEDS]` (6 seeds: some 10 minutes of one core).

Every baseline with a setting replays two scenes, with a careless human, at levels 1 and 2, once for each value of a
grid; seeds count from 100,000, where no table of results takes any. The value with the most strict successes is chosen;
of equals the one whose goals have the smallest mean error along what contacts fix. Prints the table and writes
`benchmarks/results/tuning.json`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

from apo_bench.benchmark.stages import Shown, attempt, see, show
from apo_bench.correction.correct import correct
from apo_bench.correction.least_squares import least_squares
from apo_bench.correction.penalty import penalty
from apo_bench.correction.snap import snap
from apo_bench.observation.noise import Level, make_noise
from apo_bench.pose_error import goal_errors
from apo_bench.program import Plan
from apo_bench.scenario_file import load_scenario
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.simulation.settle import settle

SCENARIOS, LEVELS, CARELESS, FIRST_SEED = ("stick_in_tower", "vanished_fixture"), (1.0, 2.0), 1.0, 100_000
GRIDS: Mapping[str, tuple[Callable[..., Any], str, tuple[float, ...]]] = {
    "least-squares": (least_squares, "contact_m", (1e-3, 3e-4, 1e-4, 1e-5, 1e-6)),
    "penalty": (penalty, "contact_m", (1e-3, 3e-4, 1e-4, 3e-5)),
    "settle": (settle, "lift_m", (0.0, 1e-3, 3e-3)),
}
"""Corrector -> what is tuned, the keyword, its values [m]."""
UNTUNED = {"snap": snap}
"""Shown beside them; it has nothing to set."""
RESULT = Path(__file__).parent / "results" / "tuning.json"


class Replayed(NamedTuple):
    """One replay."""

    success: bool
    gap_mm: float
    fixed_mm: float
    """Mean error of the corrected goals along what contacts fix."""
    free_mm: float


def main(seeds: int = 6) -> None:
    cells: dict[tuple[str, str, float | None, float], list[Replayed]] = {}
    for name in SCENARIOS:
        scene = build_scene(load_scenario(name))
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            shown = show(scene, CARELESS, seed)
            for level in LEVELS:
                for method, value, corrector in _settings():
                    key = (name, method, value, level)
                    cells.setdefault(key, []).append(_replayed(scene, shown, level, seed, corrector))
    lines = [_line(key, replays) for key, replays in cells.items()]
    chosen = {method: _best(method, cells) for method in GRIDS}
    for line in lines:
        print(*(f"{key} {value}" for key, value in line.items()), sep=", ")
    print("chosen:", *(f"{method} {GRIDS[method][1]} = {value:g}" for method, value in chosen.items()), sep="\n")
    command = f"python benchmarks/tune.py {seeds}"
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(json.dumps({"command": command, "chosen": chosen, "cells": lines}, indent=1) + "\n")


def _settings() -> list[tuple[str, float | None, Callable[..., Any]]]:
    tuned = [
        (method, value, partial(corrector, **{keyword: value}))
        for method, (corrector, keyword, values) in GRIDS.items()
        for value in values
    ]
    return [*tuned, *((method, None, corrector) for method, corrector in UNTUNED.items())]


def _replayed(scene: Scene, shown: Shown, level: float, seed: int, corrector: Callable[..., Any]) -> Replayed:
    seen, truth = see(scene, shown, make_noise("isotropic", Level(level, level)), seed), shown.layout.goals
    made = correct(seen, corrector)
    fixed_mm, free_mm = goal_errors(seen.assembly, seen.start, truth, made.goals)
    won = made.ok and attempt(Plan(seen.assembly, seen.start, made.goals), scene, truth).verdict.success
    return Replayed(bool(won), made.gap_after_m * 1e3, fixed_mm, free_mm)


def _line(key: tuple[str, str, float | None, float], replays: list[Replayed]) -> dict[str, Any]:
    scenario, method, value, level = key
    return {
        "scenario": scenario,
        "level": level,
        "method": method,
        "value": value,
        "n": len(replays),
        "won": sum(replay.success for replay in replays),
        "gap_mm": round(mean(replay.gap_mm for replay in replays), 4),
        "fixed_mm": round(mean(replay.fixed_mm for replay in replays), 3),
        "free_mm": round(mean(replay.free_mm for replay in replays), 3),
    }


def _best(method: str, cells: Mapping[tuple[str, str, float | None, float], list[Replayed]]) -> float:
    def worth(value: float) -> tuple[int, float]:
        replays = [replay for key, cell in cells.items() if key[1:3] == (method, value) for replay in cell]
        return sum(replay.success for replay in replays), -mean(replay.fixed_mm for replay in replays)

    return max(GRIDS[method][2], key=worth)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
