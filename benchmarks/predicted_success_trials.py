"""Trials that measure predicted success: the score of a plan before its execution, and whether it succeeded."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from apo_bench.assembly import Observation
from apo_bench.records import TrialConfig
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.planning import apply_method
from apo_bench.trial.predicted_success import explanations, plan_score
from apo_bench.trial.run import noise_of, run_trial
from apo_bench.trial.trial_stages import (
    SimulatedDemonstration,
    draw_robot_error,
    observe_demonstration,
    replay_and_judge,
    scene_of,
    simulate_demonstration,
    trial_outcome,
)
from benchmarks.block_assemblies import scenario_of_blocks
from benchmarks.generated import scenario_of

CALIBRATION = "calibration"
HELD_OUT = "held-out"
NO_PLAN = "no_plan"  # code of a trial whose method made no plan
SCENARIOS = (
    *("stick_in_tower", "vanished_fixture", "pocket_table", "carried_bridge", "block_on_block", "bridge_cycle"),
    *("stick_on_castles", "l_bracket_on_plate", "wedge_under_roof", "dovetail", "shaft_through_brackets"),
    *("peg_in_hole", "fixture_alignment", "nested_bushings"),
)
SLOW = "gearbox"  # a trial takes as long as a dozen others
EACH = 3  # SLOW has every third seed
COLUMNS = ("set", "scenario", "seed", "method", "noise", "noise_mm", "robot_error", "success", "code", "score")


class Condition(NamedTuple):
    """The settings of a trial, but for its scenario."""

    method: str
    noise: str
    noise_mm: float = 1.0
    robot_error: str = "none"


CONDITIONS = (
    *(Condition("contact-robust", noise) for noise in ("megapose-tless", "benchmarks/gross.toml")),
    *(Condition("contact-robust", kind) for kind in ("flips", "stale", "swaps", "rays", "displaced-view")),
    *(Condition("contact-robust", "isotropic", noise_mm) for noise_mm in (8.0, 2.0)),
    *(Condition("contact", noise) for noise in ("megapose-tless", "stale", "flips")),
    *(Condition("snap", "isotropic", noise_mm) for noise_mm in (0.1, 0.25)),
    Condition("uncorrected", "isotropic", 0.1),
    *(
        Condition("contact-robust", "isotropic", 1.0, error)
        for error in ("hand_eye:0.25/0.05", "hand_eye:0.1/0.02", "tool:0.25", "in_hand:0.25/0.5", "joints:0.02")
    ),
)
Line = Mapping[str, str]


def read_lines(path: Path) -> list[Line]:
    """Return the saved trials."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def save(path: Path, lines: Iterable[Line]) -> None:
    """Append trials to a file."""
    new = not path.exists()
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(lines)


def run_calibration(folder: Path, kind: str, numbers: Iterable[int], known: Iterable[Line]) -> Iterator[list[Line]]:
    """Run all conditions of each generated assembly; one that `oracle` cannot build has no trial.

    Args:
        kind: `blocks`, or `generated`: with round parts, which take ten times as long.
    """
    there = {(line["scenario"], line["seed"]) for line in known}
    for number in numbers:
        name = f"{kind}_{number}"
        path = folder / name / f"{name}.toml"
        seed = 2000 + 10 * number
        if (name, str(seed)) in there:
            continue
        if not path.exists():
            (scenario_of if kind == "generated" else scenario_of_blocks)(number, path.parent)
        scene = _scene(str(path))
        best = run_trial(_settings(str(path), scene.clearance_mm, 1, Condition("oracle", "isotropic")), scene)
        if best["success"]:
            yield list(_trials(CALIBRATION, name, str(path), scene, seed))


def run_held_out(seeds: Iterable[int], known: Iterable[Line]) -> Iterator[list[Line]]:
    """Run all conditions of each scenario of the benchmark and seed."""
    there = {(line["scenario"], line["seed"]) for line in known}
    for seed in seeds:
        for name in (*SCENARIOS, *(SLOW if seed % EACH == 0 else ())):
            if (name, str(seed)) not in there:
                yield list(_trials(HELD_OUT, name, name, _scene(name), seed))


def _scene(scenario: str) -> Scene:
    loaded = load_scenario(scenario)
    return scene_of(_settings(scenario, loaded.clearance_mm, 0, CONDITIONS[0]), loaded)


def _settings(scenario: str, clearance_mm: float, seed: int, condition: Condition) -> TrialConfig:
    return TrialConfig(
        scenario,
        method=condition.method,
        noise=condition.noise,
        noise_mm=condition.noise_mm,
        noise_deg=condition.noise_mm,
        robot_error=condition.robot_error,
        clearance_mm=clearance_mm,
        seed=seed,
        fidelity="near-contact",
    )


def _trials(kind: str, name: str, scenario: str, scene: Scene, seed: int) -> Iterator[Line]:
    first = _settings(scenario, scene.clearance_mm, seed, CONDITIONS[0])
    simulated = simulate_demonstration(scene, first.human_error_scale, seed)
    cache = ReplayCache()
    for condition in CONDITIONS if simulated.demonstration.code == "ok" else ():
        settings = _settings(scenario, scene.clearance_mm, seed, condition)
        success, code, score = _trial(settings, scene, simulated, cache)
        place = (condition.method, condition.noise, f"{condition.noise_mm:g}", condition.robot_error)
        values = (kind, name, str(seed), *place, success, code, score)
        yield dict(zip(COLUMNS, values, strict=True))


def _trial(
    settings: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, cache: ReplayCache
) -> tuple[str, str, str]:
    """Return success, code and score, as they are saved."""
    seen: Observation = observe_demonstration(simulated, noise_of(settings, scene, simulated), settings.seed)
    made = apply_method(settings.method, seen, None, where=scene)
    if made.plan is None:
        return "0", NO_PLAN, ""
    explained = explanations(made.correction, seen, made.plan.target_poses)
    score = plan_score(made.plan, explained, scene, settings.robot_error)
    error = draw_robot_error(settings.robot_error, scene, settings.seed)
    truth = simulated.layout.poses
    config = ExecutionConfig(settings.fidelity, robot_error=error)
    attempt = replay_and_judge(made.plan, scene, truth, None, config, cache)
    return str(int(attempt.verdict.success)), trial_outcome(attempt).code, repr(score)
