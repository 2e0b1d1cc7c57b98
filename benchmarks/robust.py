"""Keep what `contact-robust` is worth: `python benchmarks/robust.py FOLDER [FOLDER ...] [--trials N]`.

Takes sweeps of benchmarks/robust.toml, whole or not, and writes results/robust.csv, one line for each cell, and
the last part of docs/results/robust.md: success with Wilson's 95 % intervals, and the paired difference to `contact`
with Tango's.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import tango, wilson
from apo_bench.records import TrialRecord
from apo_bench.records.run.run_folder import read_records
from benchmarks.asked import ROBUST, block
from benchmarks.made_with import mujoco_of, with_mujoco

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "robust.csv"
PAGE = ROOT / "docs" / "results" / "robust.md"
NAMES = {
    "benchmarks/gross.toml": "24 % gross outliers, 1 mm and 1 degree",
    "outliers": "10 % ten times as bad, 2 % missed",
}
PLAIN = "isotropic"
HEADING = "# In simulation"


class Place(NamedTuple):
    """One cell."""

    noise: str
    noise_level: float
    clearance_mm: float
    human_error_scale: float
    scenario: str
    method: str
    max_reobservations: int


class Count(NamedTuple):
    trials: int
    successes: int


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folders", nargs="+", type=Path)
    asked.add_argument("--trials", type=int, help="the first so many seeds only")
    given = asked.parse_args()
    rows = [row for folder in given.folders for row in read_records(folder) if row["success"] is not None]
    rows = [row for row in rows if given.trials is None or row["seed"] < given.trials]
    cells = counted(rows)
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, *Count._fields])
        writer.writerows([*place, *count] for place, count in sorted(cells.items()))
    before = PAGE.read_text(encoding="utf-8").partition(f"#{HEADING}\n")[0]
    written = with_mujoco("\n".join(page(rows, cells)) + "\n", mujoco_of(given.folders))
    # It is the last part of its page, so its heading is one of the second order there.
    PAGE.write_text(f"{before}#{written}", encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def counted(rows: Iterable[TrialRecord]) -> dict[Place, Count]:
    found: dict[Place, list[bool]] = defaultdict(list)
    for row in rows:
        found[place_of(row)].append(bool(row["success"]))
    return {place: Count(len(ends), sum(ends)) for place, ends in found.items()}


def place_of(row: TrialRecord) -> Place:
    max_reobservations = int(row["max_reobservations"] or 0) if row["method"] == "contact-robust" else 0
    given = (row["noise_mm"], row["clearance_mm"], row["human_error_scale"])
    return Place(str(row["noise"]), *map(float, given), str(row["scenario"]), str(row["method"]), max_reobservations)


def page(rows: list[TrialRecord], cells: Mapping[Place, Count]) -> list[str]:
    scenarios = sorted({place.scenario for place in cells})
    return [
        HEADING,
        "",
        "Written by `python benchmarks/robust.py` from sweeps of `benchmarks/robust.toml`; counts in "
        "`benchmarks/results/robust.csv`. Success: the finished assembly is right; Wilson's 95 % intervals, the four "
        "tasks pooled, the same seeds for every method. `--max-reobservations N` lets `contact-robust` see operations again up to "
        "N times, with the same noise, outliers included.",
        "",
        block(ROBUST),
        "",
        f"| noise, level 1 | method | looks | all | {' | '.join(scenarios)} |",
        f"|---|---|---|---|{'---|' * len(scenarios)}",
        *(
            line(noise, method, max_reobservations, scenarios, cells)
            for noise, method, max_reobservations in lines(cells)
        ),
        "",
        "Paired differences of `contact-robust` without looks and `contact`, with Tango's 95 % intervals:",
        "",
        "| noise | pairs | `contact` | `contact-robust` | difference |",
        "|---|---|---|---|---|",
        *(difference(noise, rows) for noise in dict.fromkeys(noise for noise, _, _ in lines(cells))),
        *([difference(PLAIN, rows)] if any(row["noise"] == PLAIN for row in rows) else []),
        "",
        "Without outliers (`isotropic`): levels 0.5 to 8, careful and careless humans.",
    ]


def lines(cells: Mapping[Place, Count]) -> list[tuple[str, str, int]]:
    return sorted({(place.noise, place.method, place.max_reobservations) for place in cells if place.noise != PLAIN})


def line(noise: str, method: str, max_reobservations: int, scenarios: list[str], cells: Mapping[Place, Count]) -> str:
    each = [pooled(cells, noise, method, max_reobservations, (scenario,)) for scenario in scenarios]
    whole = pooled(cells, noise, method, max_reobservations, scenarios)
    low, high = wilson(whole.successes, whole.trials)
    said = " | ".join(f"{one.successes} of {one.trials}" for one in each)
    rate = f"{100 * whole.successes / whole.trials:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
    shown = max_reobservations if method == "contact-robust" else ""
    return f"| {NAMES.get(noise, f'`{noise}`')} | `{method}` | {shown} | {rate} | {said} |"


def pooled(
    cells: Mapping[Place, Count], noise: str, method: str, max_reobservations: int, scenarios: Iterable[str]
) -> Count:
    wanted = set(scenarios)
    each = [
        n
        for p, n in cells.items()
        if (p.noise, p.method, p.max_reobservations) == (noise, method, max_reobservations) and p.scenario in wanted
    ]
    return Count(sum(n.trials for n in each), sum(n.successes for n in each))


def difference(noise: str, rows: Iterable[TrialRecord]) -> str:
    ends: dict[tuple[object, ...], dict[str, bool]] = defaultdict(dict)
    for row in rows:
        place = place_of(row)
        if place.noise == noise and place.max_reobservations == 0:
            ends[*place[:5], row["seed"]][place.method] = bool(row["success"])
    pairs = [
        (end["contact"], end["contact-robust"]) for end in ends.values() if {"contact", "contact-robust"} <= set(end)
    ]
    won = sum(b and not a for a, b in pairs)
    lost = sum(a and not b for a, b in pairs)
    low, high = tango(won, lost, len(pairs))
    plain, robust = (sum(pair[i] for pair in pairs) for i in (0, 1))
    said = f"{100 * (won - lost) / len(pairs):+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"
    return f"| {NAMES.get(noise, f'`{noise}`')} | {len(pairs)} | {plain} | {robust} | {said} |"


if __name__ == "__main__":
    main()
