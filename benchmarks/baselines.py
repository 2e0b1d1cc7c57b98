"""Count how often baselines succeed in each scenario, and say what that means: `python benchmarks/baselines.py FOLDER`.

Takes a sweep of benchmarks/baselines.toml (20 minutes on one core) and writes results/baselines.csv, one line for each
scenario, method and noise level. `python docs/task_sheets.py` writes the counts on the task sheets.
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
"""Methods and noise levels of a task sheet."""
ENOUGH = 0.95  # success rate from which `snap` is enough
HALF = 0.5  # success rate up to which a scenario needs more than `snap`
FAILS = 0.2  # success rate up to which `nominal` is of no use
HEAD = """\
Each sheet says under *What it asks for* how often the [methods](methods.md) succeed: no human error, a noise of 2 mm
and 2 degrees (1 sigma per axis; `nominal` also at 4), the same seeds for every method. `apo-bench sweep
benchmarks/baselines.toml --out FOLDER`, `python benchmarks/baselines.py FOLDER` and `python docs/task_sheets.py` make
the numbers. `snap` puts each part onto its newest contacts: where it is enough, neither loops of contacts nor history
matter. `nominal` builds the assembly of the scenario's file, wherever the parts are.

[Generated assemblies](generated.md) are further scenarios."""


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
        return f"{self.successes} of {self.trials}"


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


def describe(scenario: Scenario, counts: Mapping[Place, Count]) -> str:
    """Return a table of the baselines of a scenario, and what it means, in Markdown."""
    of = {(method, noise_mm): counts[Place(scenario.name, method, noise_mm)] for method, noise_mm in COLUMNS}
    heads = [f"`{method}` at {noise_mm:g}" if noise_mm else f"`{method}`" for method, noise_mm in COLUMNS]
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads), f"| {' | '.join(map(str, of.values()))} |"]
    return "\n".join([*lines, "", f"- {_snap(of['snap', 2.0])}", f"- {_nominal(scenario, of['nominal', 4.0])}"])


def _snap(count: Count) -> str:
    if count.rate >= ENOUGH:
        return "`snap` is enough: neither loops of contacts nor history matter."
    if count.rate <= HALF:
        return f"`snap` is not enough ({count} at 2 mm): parts that were put down before have to move, too."
    return f"`snap` is not enough in part of the layouts ({count} at 2 mm)."


def _nominal(scenario: Scenario, count: Count) -> str:
    if count.rate <= FAILS:
        return f"Nominal poses fail ({count} at 4 mm): fixed parts determine where the assembly stands."
    why = (
        "a layout moves its parts by less than half of a face, and half is what the judge asks for"
        if scenario.success_means == "as_demonstrated"
        else "the assembly stands on the plain table alone, so it is right anywhere, and no shift along faces of its "
        "size leaves less than half of the demonstrated contacts"
    )
    return f"Nominal poses are enough ({count} at 4 mm): {why}."


def describe_nominal(scenarios: Iterable[Scenario], counts: Mapping[Place, Count]) -> str:
    """Return how often `nominal` succeeds in each scenario, in Markdown: where it is enough first."""
    noise_mm = COLUMNS[-1][1]
    found = {scenario.name: counts[Place(scenario.name, "nominal", noise_mm)] for scenario in scenarios}
    few = sum(count.rate <= FAILS for count in found.values())
    lines = [
        f"At {noise_mm:g} mm and {noise_mm:g} degrees, without human error, `nominal` succeeds in at most "
        f"{100 * FAILS:g} % of the trials in {few} of {len(found)} scenarios "
        "([measured](../reference/scenarios.md)):",
        "",
        "| scenario | `nominal` |",
        "|---|---|",
    ]
    by_rate = sorted(found.items(), key=lambda item: (-item[1].rate, item[0]))
    return "\n".join([*lines, *(f"| `{name}` | {count} |" for name, count in by_rate)])


if __name__ == "__main__":
    main()
