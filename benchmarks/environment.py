"""Rates of simple policies in `APOReplay-v0`: `python benchmarks/environment.py [SCENARIO...]`.

Every scenario as the environment is made by default (1 mm and 1 degree, the scenario's carelessness), seeds 0, 1, ..:
random actions in the environment; zeros (as seen), a corrector before zeros, and `oracle`, which no environment has,
as the same trials by `run_trial` at fidelity near-contact. Writes results/environment.csv and the table in
docs/guide/environment.md.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

import gymnasium

import apo_bench
from apo_bench.records import TrialConfig
from apo_bench.scenario.file import scenario_names
from apo_bench.trial.stages import simulate_demonstration
from apo_bench.trial.trial import run_trial

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "environment.csv"
PAGE = ROOT / "docs" / "guide" / "environment.md"
BEGIN = "<!-- table: python benchmarks/environment.py -->"
END = "<!-- end of table -->"
POLICIES = ("random", "uncorrected", "snap", "contact-robust", "oracle")
SEEDS = range(10)
LEFT_OUT = ("gearbox",)
"""Ten operations: a random action alone takes minutes."""
ID = "APOReplay-v0"
FAST = "contact"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("scenarios", nargs="*", help="measured anew; the others stay as they are kept. All but gearbox")
    given = asked.parse_args()
    counted = kept()
    for scenario in given.scenarios or [name for name in scenario_names() if name not in LEFT_OUT]:
        found = {"random": sum(random_actions(scenario, SEEDS)), **methods(scenario, SEEDS)}
        counted |= {(scenario, policy): count for policy, count in found.items()}
        print(scenario, found, "of", len(SEEDS), flush=True)
        keep(counted)
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    block = "\n".join([BEGIN, "", *table(counted, len(SEEDS)), "", END])
    PAGE.write_text(before + block + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {KEPT} and the table of {PAGE}")


def kept() -> dict[tuple[str, str], int]:
    """Successes by scenario and policy."""
    if not KEPT.exists():
        return {}
    with KEPT.open(encoding="utf-8", newline="") as file:
        return {(row["scenario"], row["policy"]): int(row["successes"]) for row in csv.DictReader(file)}


def keep(counted: Mapping[tuple[str, str], int]) -> None:
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("scenario", "policy", "trials", "successes"))
        for scenario in sorted({scenario for scenario, _ in counted}):
            writer.writerows((scenario, policy, len(SEEDS), counted[scenario, policy]) for policy in POLICIES)


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
        shown = {
            human_error_scale: simulate_demonstration(scene, human_error_scale, seed)
            for human_error_scale in (0.0, 1.0)
        }
        for method in right:
            noise_mm, human_error_scale = (0.0, 0.0) if method == "oracle" else (1.0, 1.0)
            trial = TrialConfig(
                scenario,
                method=method,
                seed=seed,
                noise_mm=noise_mm,
                noise_deg=noise_mm,
                human_error_scale=human_error_scale,
                fidelity=FAST,
            )
            right[method] += bool(run_trial(trial, scene, simulated=shown[human_error_scale])["success"])
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
