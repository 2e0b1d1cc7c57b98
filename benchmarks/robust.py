"""Write how often `contact-robust` succeeds under outliers: `python benchmarks/robust.py FOLDER [FOLDER ...]`.

Takes sweeps of benchmarks/robust.toml, whole or not, and writes results/robust.csv, one line for each condition, and
docs/results/robust.md but for its part on wrong contacts.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import Rate, compute_tango_interval, format_percent
from apo_bench.records import TrialRecord
from benchmarks.provenance import mujoco_of, share_of_sweep
from benchmarks.rates_by_condition import counted, fraction, group, rate_of, read_judged, table

ROOT = Path(__file__).parents[1]
SWEEP = ROOT / "benchmarks" / "robust.toml"
KEPT = ROOT / "benchmarks" / "results" / "robust.csv"
PAGE = ROOT / "docs" / "results" / "robust.md"
NOISES = {
    "benchmarks/gross.toml": "24 % gross outliers, 1 mm and 1 degree",
    "megapose-tless": "`megapose-tless`",
    "outliers": "10 % ten times as large, 2 % missed",
}
WITHOUT_OUTLIERS = "isotropic"
WRONG_CONTACTS = "<!-- wrong contacts -->"  # where the part of wrong_contacts.py begins


class Place(NamedTuple):
    """A condition."""

    noise: str
    noise_mm: float
    clearance_mm: float
    human_error_scale: float
    scenario: str
    method: str
    max_reobservations: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    folders = parser.parse_args().folders
    rows = read_judged(folders)
    rates = {place: rate_of(each) for place, each in group(rows, place_of).items()}
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, "trials", "successes"])
        writer.writerows([*place, rate.trials, rate.successes] for place, rate in sorted(rates.items()))
    _, mark, rest = PAGE.read_text(encoding="utf-8").partition(WRONG_CONTACTS)
    written = "\n".join(page(rows, rates, mujoco_of(folders)))
    PAGE.write_text(f"{written}\n\n{mark}{rest}", encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def place_of(row: TrialRecord) -> Place:
    """Return the condition of a trial; methods that cannot observe again have no reobservations."""
    return Place(
        str(row["noise"]),
        float(row["noise_mm"] or 0.0),
        float(row["clearance_mm"]),
        float(row["human_error_scale"] or 0.0),
        str(row["scenario"]),
        str(row["method"]),
        int(row.get("max_reobservations") or 0) if row["method"] == "contact-robust" else 0,
    )


def page(rows: list[TrialRecord], rates: Mapping[Place, Rate], versions: Sequence[str]) -> list[str]:
    scenarios = sorted({place.scenario for place in rates})
    found = sorted({(p.noise, p.method, p.max_reobservations) for p in rates if p.noise in NOISES})
    robust, plain = (
        add(rate for p, rate in rates.items() if p.noise in NOISES and (p.method, p.max_reobservations) == (method, 0))
        for method in ("contact-robust", "contact")
    )
    return [
        "# Outliers",
        "",
        f"Under outliers `contact-robust` succeeds in {format_percent(robust.rate)} of the trials without "
        f"reobservations, `contact` in {format_percent(plain.rate)}. It also rejects [wrong "
        "contacts](#wrong-contacts), where other contacts contradict them.",
        "",
        "## Outliers in simulation",
        "",
        *table(
            ("noise, 1 mm and 1 degree", "method", "reobservations", "all", *scenarios),
            [line(*each, scenarios, rates) for each in found],
        ),
        "",
        "Paired differences of `contact-robust` without reobservations and `contact`, with Tango's 95 % intervals. "
        f"`{WITHOUT_OUTLIERS}` has no outliers: 0.5 to 8 mm and degrees, with and without human error.",
        "",
        *table(
            ("noise", "pairs", "`contact`", "`contact-robust`", "difference"),
            [compare(noise, rows) for noise in (*NOISES, WITHOUT_OUTLIERS)],
        ),
        "",
        "Written by `python benchmarks/robust.py` from sweeps of `benchmarks/robust.toml`; the counts are in "
        "`benchmarks/results/robust.csv`. Success: the finished assembly is right; Wilson's 95 % intervals over the "
        "four tasks; the same seeds for every method. Reobservations are fresh draws of the same noise, outliers "
        f"included. {share_of_sweep(len(rows), SWEEP)} Simulated with MuJoCo {' and '.join(versions)}.",
    ]


def line(
    noise: str, method: str, reobservations: int, scenarios: Iterable[str], rates: Mapping[Place, Rate]
) -> list[object]:
    """Return a line of the table of rates."""
    place = (noise, method, reobservations)
    own = [(p.scenario, rate) for p, rate in rates.items() if (p.noise, p.method, p.max_reobservations) == place]
    each = [add(rate for scenario, rate in own if scenario == name) for name in scenarios]
    return [
        NOISES[noise],
        f"`{method}`",
        reobservations,
        counted(add(each)),
        *map(fraction, each),
    ]


def add(rates: Iterable[Rate]) -> Rate:
    """Pool the trials of several conditions."""
    counts = list(rates)
    return Rate(sum(rate.successes for rate in counts), sum(rate.trials for rate in counts))


def compare(noise: str, rows: Iterable[TrialRecord]) -> list[object]:
    """Return a line of the table of paired differences."""
    ends: dict[tuple[object, ...], dict[str, bool]] = defaultdict(dict)
    for row in rows:
        place = place_of(row)
        if place.noise == noise and place.max_reobservations == 0:
            ends[*place[:5], row["seed"]][place.method] = bool(row["success"])
    both = [end for end in ends.values() if {"contact", "contact-robust"} <= set(end)]
    plain, robust = (sum(end[method] for end in both) for method in ("contact", "contact-robust"))
    won = sum(end["contact-robust"] and not end["contact"] for end in both)
    low, high = compute_tango_interval(won, won - (robust - plain), len(both))
    difference = f"{100 * (robust - plain) / max(1, len(both)):+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"
    return [NOISES.get(noise, f"`{noise}`"), len(both), plain, robust, difference]


if __name__ == "__main__":
    main()
