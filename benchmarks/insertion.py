"""Policies of `APOInsert-v0` in the same trials: `python -m benchmarks.insertion`.

Success of each policy in each scenario, and why it fails, with the defaults of the environment: the last operation by a
robot with a hand-eye error of 0.5 mm and 0.1 degrees. Trials that fail before the operation do not count. Results are
appended to results/insertion.csv, trial by trial, so that the script goes on where it was ended; then it writes the
table in docs/guide/insertion.md.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from apo_bench import TrialConfig
from apo_bench.benchmark.analysis import Rate
from apo_bench.envs.evaluation import REASONS, EpisodeResult, evaluate_policy
from apo_bench.envs.policies import PROBES, insert_env
from benchmarks.rates_by_condition import counted, table

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results" / "insertion.csv"
PAGE = ROOT / "docs" / "guide" / "insertion.md"
BEGIN = "<!-- table: python -m benchmarks.insertion -->"
END = "<!-- end of table -->"
SCENARIOS = ("stick_in_tower", "dovetail", "peg_in_hole", "shaft_through_brackets", "l_bracket_on_plate")
POLICIES = ("straight", "spiral", "searcher", "probe")
FIRST = 1000
COLUMNS = ("scenario", "policy", "trial", "success", "reason", "code", "actions", "deepest_mm", "peak_force_n")
NOT_BEGUN = "not begun"
"""In place of a reason: the trial fails before the operation."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--policies", nargs="+", default=list(POLICIES))
    parser.add_argument("--trials", type=int, default=40, help="trials of each scenario (40)")
    parser.add_argument("--page", action="store_true", help="write the table from the results that are there")
    given = parser.parse_args()
    if not given.page:
        run(given.scenarios, given.policies, range(FIRST, FIRST + given.trials))
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    block = "\n".join([BEGIN, "", *list_lines(read_results()), "", END])
    PAGE.write_text(before + block + rest.split(END, 1)[1], encoding="utf-8")
    print(f"Wrote the table of {PAGE}")


def run(scenarios: Sequence[str], policies: Sequence[str], trials: range) -> None:
    """Append a row for each episode that is not in the results yet, trial by trial in turn over the scenarios."""
    done = {(row["scenario"], row["policy"], int(row["trial"])) for row in read_results()}
    envs: dict[tuple[str, bool], Any] = {}
    for trial in trials:
        for scenario in scenarios:
            for policy in policies:
                if (scenario, policy, trial) in done:
                    continue
                key = scenario, policy in PROBES
                if key not in envs:
                    envs[key] = insert_env(TrialConfig(scenario, method="contact-robust"), policy)
                results = list(evaluate_policy(envs[key], policy, [trial]))
                write_row(scenario, policy, trial, results[0] if results else None)


def write_row(scenario: str, policy: str, trial: int, result: EpisodeResult | None) -> None:
    """Append an episode; one that did not begin has no success."""
    facts = ("", NOT_BEGUN, "", "", "", "") if result is None else (int(result.success), *result[2:])
    new = not KEPT.exists()
    with KEPT.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(COLUMNS)
        writer.writerow((scenario, policy, trial, *facts))


def read_results() -> list[dict[str, str]]:
    """Return the rows of all episodes."""
    if not KEPT.exists():
        return []
    with KEPT.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def list_lines(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the table: a line for each scenario and policy, over the trials that begin."""
    heads = ("scenario", "policy", "success", *REASONS)
    lines: list[list[object]] = []
    for scenario in SCENARIOS:
        for name in POLICIES:
            mine = [row for row in rows if (row["scenario"], row["policy"]) == (scenario, name) and row["success"]]
            if not mine:
                continue
            rate = Rate(sum(row["success"] == "1" for row in mine), len(mine))
            reasons = Counter(row["reason"] for row in mine)
            lines.append([f"`{scenario}`", f"`{name}`", counted(rate), *(reasons[reason] for reason in REASONS)])
    return table(heads, lines)


if __name__ == "__main__":
    main()
