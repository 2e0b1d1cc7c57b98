"""Count the successes of simple policies in `APOReplay-v0`: `python benchmarks/environment.py [SCENARIO ...]`.

Every scenario with the defaults of the environment: 1 mm and 1 degree, the human error of the scenario, seeds 0 to 9.
Random actions run in the environment. Zeros (`uncorrected`), zeros after a corrector, and `oracle`, which no
environment has, are the same trials by `run_trial` at fidelity near-contact. Writes results/environment.csv and the
table in docs/guide/environment.md.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Mapping
from pathlib import Path

import gymnasium

from apo_bench import TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.scenario.scenario_file import list_scenario_names
from apo_bench.trial.trial_stages import simulate_demonstration
from benchmarks.rates_by_condition import table

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "environment.csv"
PAGE = ROOT / "docs" / "guide" / "environment.md"
BEGIN = "<!-- table: python benchmarks/environment.py -->"
END = "<!-- end of table -->"
POLICIES = ("random", "uncorrected", "snap", "contact-robust", "oracle")
SEEDS = range(10)
LEFT_OUT = "gearbox"  # ten operations: one random action takes minutes
ID = "APOReplay-v0"
Counts = Mapping[tuple[str, str], int]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenarios", nargs="*", help="scenarios to run again (all but gearbox)")
    given = parser.parse_args()
    counts = read_counts()
    for scenario in given.scenarios or [name for name in list_scenario_names() if name != LEFT_OUT]:
        counts[scenario, "random"] = count_random_actions(scenario)
        for method in POLICIES[1:]:
            counts[scenario, method] = count_trials(scenario, method)
        with KEPT.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("scenario", "policy", "trials", "successes"))
            writer.writerows((*place, len(SEEDS), count) for place, count in counts.items())
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    block = "\n".join([BEGIN, "", *lines(counts), "", END])
    PAGE.write_text(before + block + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote {KEPT} and the table of {PAGE}")


def read_counts() -> dict[tuple[str, str], int]:
    """Return the committed successes by scenario and policy."""
    with KEPT.open(encoding="utf-8", newline="") as file:
        return {(row["scenario"], row["policy"]): int(row["successes"]) for row in csv.DictReader(file)}


def count_random_actions(scenario: str) -> int:
    """Count the seeds at which one uniform action of the space succeeds."""
    env = gymnasium.make(ID, scenario=scenario)
    right = 0
    for seed in SEEDS:
        env.reset(seed=seed)
        env.action_space.seed(seed)
        right += env.step(env.action_space.sample())[1] == 1.0
    env.close()
    return right


def count_trials(scenario: str, method: str) -> int:
    """Count the seeds at which a method succeeds; the oracle meets neither noise nor human error."""
    scene = build_scene(load_scenario(scenario))
    noise, human_error_scale = (0.0, 0.0) if method == "oracle" else (1.0, 1.0)
    right = 0
    for seed in SEEDS:
        trial = TrialConfig(
            scenario,
            method=method,
            seed=seed,
            noise_mm=noise,
            noise_deg=noise,
            human_error_scale=human_error_scale,
            fidelity="near-contact",
        )
        shown = simulate_demonstration(scene, human_error_scale, seed)
        right += bool(run_trial(trial, scene, simulated=shown)["success"])
    return right


def lines(counts: Counts) -> list[str]:
    """Return the table: a line per scenario, and one of all."""
    scenarios = sorted({scenario for scenario, _ in counts})
    heads = (f"scenario, of {len(SEEDS)}", "random", "zeros (`uncorrected`)", "`snap`", "`contact-robust`", "`oracle`")
    rows: list[list[object]] = []
    for scenario in scenarios:
        link = f"[{scenario}](../reference/scenarios.md#{scenario})"
        rows.append([link, *(counts[scenario, policy] for policy in POLICIES)])
    sums = [sum(counts[scenario, policy] for scenario in scenarios) for policy in POLICIES]
    return table(heads, [*rows, [f"all, of {len(SEEDS) * len(scenarios)}", *sums]])


if __name__ == "__main__":
    main()
