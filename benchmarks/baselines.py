"""Keep what each scenario asks for: `python benchmarks/baselines.py FOLDER`.

Takes a sweep of benchmarks/baselines.toml (20 minutes on one core) and writes results/baselines.csv, one line for each
scenario, method and level. `python docs/cards.py` puts them on the cards.
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

KEPT = Path(__file__).parent / "results" / "baselines.csv"


class Place(NamedTuple):
    """One cell."""

    scenario: str
    method: str
    noise_level: float
    """Of `oracle`, which meets none, 0."""


class Count(NamedTuple):
    trials: int
    successes: int

    @property
    def rate(self) -> float:
        return self.successes / self.trials

    def __str__(self) -> str:
        return f"{self.successes} of {self.trials}"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path)
    counts = counted(read_records(asked.parse_args().folder))
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, *Count._fields])
        writer.writerows([*place, *count] for place, count in sorted(counts.items()))
    print(f"Wrote {KEPT}")


def counted(rows: Iterable[TrialRecord]) -> dict[Place, Count]:
    """Trials whose demonstration was right, and successes among them."""
    ends: dict[Place, list[bool]] = defaultdict(list)
    for row in rows:
        if row["success"] is not None:
            ends[Place(row["scenario"], row["method"], float(row["noise_mm"] or 0.0))].append(row["success"])
    return {place: Count(len(each), sum(each)) for place, each in ends.items()}


def kept() -> Mapping[Place, Count]:
    """The counts that are committed."""
    with KEPT.open(encoding="utf-8", newline="") as file:
        return {
            Place(line["scenario"], line["method"], float(line["noise_level"])): Count(
                int(line["trials"]), int(line["successes"])
            )
            for line in csv.DictReader(file)
        }


if __name__ == "__main__":
    main()
