"""Rates of simple policies in `APOReplay-v0`: `python benchmarks/environment.py [--seeds 10]`.

Every scenario as the environment is made by default (1 mm and 1 degree, the scenario's carelessness), seeds 0, 1, ..:
random actions in the environment; zeros (as seen), a corrector before zeros, and `oracle`, which an environment has not,
as the same trials by `run_trial` at fidelity contact. Writes results/environment.csv and the table in docs/guide/environment.md.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

import gymnasium

import apo_bench
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import scenario_names
from apo_bench.trial.stages import record_demonstration
from apo_bench.trial.trial import run_trial

ROOT = Path(__file__).resolve().parents[1]
KEPT, PAGE = ROOT / "benchmarks" / "results" / "environment.csv", ROOT / "docs" / "guide" / "environment.md"
BEGIN, END = "<!-- table: python benchmarks/environment.py -->", "<!-- end of table -->"
POLICIES = ("random", "none", "snap", "contact-robust", "oracle")
ID, FAST = "APOReplay-v0", "contact"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--seeds", type=int, default=10)
    seeds = range(asked.parse_args().seeds)
    counted: dict[tuple[str, str], int] = {}
    for scenario in scenario_names():
        found = {"random": sum(random_actions(scenario, seeds)), **methods(scenario, seeds)}
        counted |= {(scenario, policy): count for policy, count in found.items()}
        print(scenario, found, "of", len(seeds), flush=True)
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("scenario", "policy", "trials", "successes"))
        writer.writerows((*place, len(seeds), count) for place, count in counted.items())
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    kept = "\n".join([BEGIN, "", *table(counted, len(seeds)), "", END])
    PAGE.write_text(before + kept + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {KEPT} and the table of {PAGE}")


def random_actions(scenario: str, seeds: Iterable[int]) -> list[bool]:
    """Whether one uniform action of the space ended right, of each trial."""
    env = gymnasium.make(ID, scenario=scenario)
    ended = []
    for seed in seeds:
        env.reset(seed=seed)
        env.action_space.seed(seed)
        ended.append(env.step(env.action_space.sample())[1] == 1)
    env.close()
    return ended


def methods(scenario: str, seeds: Iterable[int]) -> dict[str, int]:
    """How often each method ended right: zeros in the environment, with that corrector before them."""
    scene = apo_bench.build_scene(apo_bench.load_scenario(scenario))
    right = dict.fromkeys(POLICIES[1:], 0)
    for seed in seeds:
        shown = {careless: record_demonstration(scene, careless, seed) for careless in (0.0, 1.0)}
        for method in right:
            level, careless = (0.0, 0.0) if method == "oracle" else (1.0, 1.0)
            trial = TrialSettings(
                scenario, method=method, seed=seed, level_mm=level, level_deg=level, careless=careless, fidelity=FAST
            )
            right[method] += bool(run_trial(trial, scene, recording=shown[careless])["success"])
    return right


def table(counted: Mapping[tuple[str, str], int], trials: int) -> list[str]:
    """A line per scenario, and one of all together."""
    scenarios = sorted({scenario for scenario, _ in counted})
    lines = [f"| scenario, of {trials} | random | zeros (`none`) | `snap` | `contact-robust` | `oracle` |"]
    lines.append("|---" + "|--:" * len(POLICIES) + "|")
    for scenario in scenarios:
        found = " | ".join(str(counted[scenario, policy]) for policy in POLICIES)
        lines.append(f"| [{scenario}](../reference/scenarios.md#{scenario}) | {found} |")
    sums = (sum(counted[scenario, policy] for scenario in scenarios) for policy in POLICIES)
    lines.append(f"| all, of {trials * len(scenarios)} | {' | '.join(map(str, sums))} |")
    return lines


if __name__ == "__main__":
    main()
