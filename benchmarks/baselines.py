"""Count how often baselines succeed in each scenario: `python benchmarks/baselines.py FOLDER`.

Takes a sweep of benchmarks/baselines.toml (20 minutes on one core) and writes results/baselines.csv, one line for each
scenario, method and noise level. `python docs/task_sheets.py` writes the counts on the page of scenarios.
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from apo_bench.records import TrialRecord
from apo_bench.records.run.run_folder import read_records
from apo_bench.scenario.scenario import Scenario

KEPT = Path(__file__).parent / "results" / "baselines.csv"
COLUMNS = (
    ("oracle", 0.0),
    ("uncorrected", 2.0),
    ("snap", 2.0),
    ("snap+spiral", 2.0),
    ("contact", 2.0),
    ("nominal", 2.0),
    ("nominal", 4.0),
)
"""Methods and noise levels of the table."""


class Place(NamedTuple):
    """A condition."""

    scenario: str
    method: str
    noise_mm: float
    """0 of `oracle`, which meets no noise."""


class Count(NamedTuple):
    """Trials whose demonstration was right, and successes among them."""

    trials: int
    successes: int

    @property
    def rate(self) -> float:
        return self.successes / self.trials

    def __str__(self) -> str:
        return f"{self.successes}/{self.trials}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    counts = count(read_records(parser.parse_args().folder))
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, *Count._fields])
        writer.writerows([*place, *each] for place, each in sorted(counts.items()))
    print(f"Wrote {KEPT}")


def count(rows: Iterable[TrialRecord]) -> dict[Place, Count]:
    """Count the trials of every condition."""
    ends: dict[Place, list[bool]] = defaultdict(list)
    for row in rows:
        if row["success"] is not None:
            ends[Place(row["scenario"], row["method"], float(row["noise_mm"] or 0.0))].append(row["success"])
    return {place: Count(len(each), sum(each)) for place, each in ends.items()}


def read_counts() -> Mapping[Place, Count]:
    """Return the committed counts."""
    with KEPT.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    return {
        Place(line["scenario"], line["method"], float(line["noise_mm"])): Count(
            int(line["trials"]), int(line["successes"])
        )
        for line in lines
    }


def difficulty(scenarios: Iterable[Scenario], counts: Mapping[Place, Count]) -> str:
    """Return a table of the baselines in every scenario, in Markdown."""
    heads = [f"`{method}` at {noise_mm:g}" if noise_mm else f"`{method}`" for method, noise_mm in COLUMNS]
    lines = [f"| scenario | {' | '.join(heads)} |", "|---" * (1 + len(COLUMNS)) + "|"]
    for scenario in scenarios:
        cells = (str(counts[Place(scenario.name, method, noise_mm)]) for method, noise_mm in COLUMNS)
        lines.append(f"| [{scenario.name}](#{scenario.name}) | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
