"""Measure robot errors, named and unnamed: `python -m benchmarks.robot_errors [--trials 20] [--only ERROR ...]`.

The package draws named errors, and the robot assumes their standard deviations. Unnamed errors have fixed amounts: the
simulated robot is changed behind the back of the package, whose robot has no error and assumes usual ones (`unknown`).
Adds seeds to the counts in results/robot_errors.csv and writes docs/results/robot-errors.md; `--trials 0` only writes.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any
from unittest import mock

import mujoco
import numpy as np

from apo_bench import Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.benchmark.analysis import Rate
from apo_bench.geometry import pose
from apo_bench.simulation.robot import RobotError, compute_sag_per_metre
from apo_bench.trial.trial_stages import SimulatedDemonstration, demonstration_of
from benchmarks.provenance import with_mujoco
from benchmarks.rates_by_condition import counted, fraction, table

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "robot_errors.csv"
PAGE = ROOT / "docs" / "results" / "robot-errors.md"
SCENARIOS = ("peg_in_hole", "stick_in_tower", "carried_bridge")
METHODS = ("contact", "contact+probe", "oracle")
COLUMNS = ("error", "scenario", "method", "trials", "successes")
HEAD = """\
# Errors of the robot

With a robot error even `oracle`, which has the true poses, fails, since contacts correct the errors of the camera and
not those of the robot. A robot that [probes](../how/probing.md) estimates its own error.
"""
MEASURED = """
## Measurement

`python -m benchmarks.robot_errors` writes this page and adds trials to `benchmarks/results/robot_errors.csv`, which
keeps the counts. Success: the finished assembly is right. All rows have the same seeds, no human error, a clearance of
0.25 mm per side, and noise of 1 mm and 1 degree (1 sigma per axis). Intervals are Wilson's of 95 %.

Every trial draws its own [named errors](../guide/robot-error.md#errors-of-the-robot), in standard deviations, and the
robot assumes these. Unnamed errors are fixed: the script changes the simulated robot, and `contact+probe` assumes
`unknown`. Heights count over the targets; those of an arm that sags grow with its reach.
"""
NAMED = (
    *("none", "hand_eye:1/0.2", "joints:0.05", "tool:0.5", "in_hand:0.5/1"),
    *("sag:0.7", "base_tilt:0.1", "finger:1", "ft_drift:2"),
)


def droop(scene: Scene, mm: float) -> None:
    """Leave weight of the arm without compensation, so that the tip hangs lower over the targets."""
    model = scene.work.model
    gains = model.actuator_gainprm[[model.actuator(f"arm/{name}").id for name in scene.arm.joints], 0]
    model.body_gravcomp *= 1.0 - 1e-3 * mm * float((gains * compute_sag_per_metre(scene))[0])


def sag(scene: Scene, mm: float) -> dict[str, Any]:
    """Let the joints yield behind their encoders."""
    return {"sag": 1e-3 * mm * compute_sag_per_metre(scene)}


def tilt(scene: Scene) -> dict[str, Any]:
    foot = pose.at(scene.arm.base)
    return {"hand_eye": foot @ pose.at((0.0, 0.0, 0.0), (0.06, 0.08, 0.0)) @ pose.inverse(foot)}


def drift(_: Scene, newton: float) -> dict[str, Any]:
    """Let the force-torque sensor drift by so much a minute."""
    return {"ft_drift": newton / 60.0 * np.array([0.6, 0.0, 0.8, 0.0, 0.05, 0.0])}


def thin_pad(scene: Scene) -> None:
    """Remove 1 mm of the inner side of one pad."""
    model = scene.work.model
    pad = model.geom("arm/left_pad").id
    model.geom_size[pad, 0] -= 0.0005
    model.geom_pos[pad, 0] -= 0.0005


def friction(scene: Scene, times: float) -> None:
    scene.work.model.geom_friction[:, 0] *= times


def heavier_parts(scene: Scene) -> None:
    parts = list(scene.work.body.values())
    scene.work.model.body_mass[parts] *= 1.5
    scene.work.model.body_inertia[parts] *= 1.5


UNNAMED: dict[str, Callable[[Scene], dict[str, Any] | None]] = {
    **{f"weight not compensated, {mm} mm": partial(droop, mm=mm) for mm in (0.3, 0.7, 1.0)},
    **{f"joints yield unseen, {mm} mm": partial(sag, mm=mm) for mm in (0.3, 0.7, 1.0)},
    "base tilted, 0.1 degrees": tilt,
    "pad 1 mm thinner": thin_pad,
    "force sensor drifts 2 N a minute": partial(drift, newton=2.0),
    "force sensor drifts 12 N a minute": partial(drift, newton=12.0),
    "friction a third": partial(friction, times=1.0 / 3.0),
    "friction three times": partial(friction, times=3.0),
    "tip off, 0.5 mm": lambda _: {"tool": pose.at((0.0003, 0.0003, 0.00026))},
    "parts 1.5 times as heavy": heavier_parts,
}
"""Change of a scene that is made for it, or fields of a `RobotError`."""


@lru_cache(maxsize=4)
def scene_of(scenario: str) -> Scene:
    return build_scene(load_scenario(scenario), clearance_mm=0.25)


@lru_cache(maxsize=4)
def demonstration(scenario: str, seed: int) -> SimulatedDemonstration:
    """The demonstration of a seed, in a scene without changes."""
    return demonstration_of(TrialConfig(scenario, seed=seed, human_error_scale=0.0), scene_of(scenario))


def succeeds(error: str, scenario: str, method: str, seed: int) -> bool:
    """Run one trial."""
    config = TrialConfig(
        scenario,
        method=method,
        seed=seed,
        human_error_scale=0.0,
        clearance_mm=0.25,
        fidelity="near-contact",
        robot_error=error if error in NAMED else "none",
        assumed_robot_error="matched" if error in NAMED else "unknown",
    )
    run = partial(run_trial, config, simulated=demonstration(scenario, seed))
    if error in NAMED:
        return bool(run(scene_of(scenario))["success"])
    scene = scene_of.__wrapped__(scenario)  # one of its own, which is changed
    fields = UNNAMED[error](scene)
    if fields is None:
        return bool(run(scene)["success"])
    none = np.eye(4)
    right = {"hand_eye": none, "joints": np.zeros(len(scene.arm.joints)), "tool": none}
    right["in_hand"] = np.tile(none, (len(scene.scenario.assembly), 1, 1))
    with mock.patch("apo_bench.trial.run.draw_robot_error", return_value=RobotError(**(right | fields))):
        return bool(run(scene)["success"])


def page(rates: dict[tuple[str, ...], Rate]) -> str:
    """Return the page, with the rates of each error, scenario and method."""

    def over(error: str, method: str) -> Rate:
        found = [rates[key] for name in SCENARIOS if (key := (error, name, method)) in rates]
        return Rate(sum(rate.successes for rate in found), sum(rate.trials for rate in found))

    measured = {error for error, _, _ in rates}
    each = [(error, name) for error in (*NAMED, *UNNAMED) if error in measured for name in SCENARIOS]
    lines = [HEAD]
    for title, errors in (("Named errors", NAMED), ("Unnamed errors", tuple(UNNAMED))):
        rows = [
            [f"`{e}`" if e in NAMED else e, *(counted(over(e, method)) for method in METHODS)]
            for e in errors
            if e in measured
        ]
        lines += [f"## {title}\n", *table(("robot error", *(f"`{m}`" for m in METHODS)), rows), ""]
    rows = [[e, name, *(fraction(rates.get((e, name, method))) for method in METHODS)] for e, name in each]
    return "\n".join([*lines, "## Each scenario\n", *table(("robot error", "scenario", *METHODS), rows), MEASURED])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20, help="seeds of each error, scenario and method")
    parser.add_argument("--only", nargs="*", default=[*NAMED, *UNNAMED], metavar="ERROR")
    parser.add_argument("--methods", nargs="*", default=METHODS)
    given = parser.parse_args()
    counts = read()
    for seed, error, scenario, method in product(range(given.trials), given.only, SCENARIOS, given.methods):
        key = error, scenario, method
        trials, right = counts.get(key, (0, 0))
        if trials == seed:
            counts[key] = trials + 1, right + succeeds(error, scenario, method, seed)
            write(counts)
    rates = {key: Rate(right, trials) for key, (trials, right) in counts.items()}
    PAGE.write_text(with_mujoco(page(rates), [mujoco.__version__]), encoding="utf-8")
    print(f"Wrote {PAGE}")


def read() -> dict[tuple[str, ...], tuple[int, int]]:
    """Return the kept trials and successes by error, scenario and method."""
    if not KEPT.exists():
        return {}
    with KEPT.open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))[1:]
    return {tuple(key): (int(trials), int(right)) for *key, trials, right in lines}


def write(counts: dict[tuple[str, ...], tuple[int, int]]) -> None:
    """Keep the counts, in the order of the page."""
    order = [key for key in product((*NAMED, *UNNAMED), SCENARIOS, METHODS) if key in counts]
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *((*key, *counts[key]) for key in order)])


if __name__ == "__main__":
    main()
