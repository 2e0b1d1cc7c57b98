"""Write how often round and tilted parts fit: `python benchmarks/round.py FOLDER [FOLDER ...] [--half HALF ...]`.

Takes sweeps of benchmarks/round.toml and gearbox.toml, whole or not, and of the same with half the time step; writes
results/round.csv, one line for each condition, and docs/results/round.md.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.records import TrialRecord
from benchmarks.provenance import mujoco_of, share_of_sweep, with_mujoco
from benchmarks.rates_by_condition import fraction, group, rate_of, read_judged, table, widths

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "round.csv"
PAGE = ROOT / "docs" / "results" / "round.md"
SWEEPS = (ROOT / "benchmarks" / "round.toml", ROOT / "benchmarks" / "gearbox.toml")
METHODS = ("uncorrected", "spiral-search", "nominal", "snap", "snap+spiral", "paper", "contact")
CHAINED = ("uncorrected", "spiral-search", "paper", "contact")
TIGHTER = ("oracle", "uncorrected", "spiral-search", "contact")
CHAIN = "gearbox"  # ten operations, one on the other
CLEARANCE_MM = 0.25  # of the scenarios


class Place(NamedTuple):
    """A condition."""

    scenario: str
    clearance_mm: float
    human_error_scale: float
    noise_mm: float
    contact_source: str
    method: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--half", nargs="*", default=[], type=Path, help="sweeps with half the time step")
    given = parser.parse_args()
    found = group(read_judged(given.folders), place_of)
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, "trials", "successes", "all_contacts_right", "error_mm"])
        for place, rows in sorted(found.items()):
            rate = rate_of(rows)
            writer.writerow(
                [*place, rate.trials, rate.successes, _detected(rows), _middle(rows, "planned_error_fixed_mm")]
            )
    written = "\n".join(page(found, read_judged(given.half))) + "\n"
    PAGE.write_text(with_mujoco(written, mujoco_of([*given.folders, *given.half])), encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def place_of(row: TrialRecord) -> Place:
    """Return the condition of a trial."""
    human_error_scale, noise_mm = (float(row[name] or 0.0) for name in ("human_error_scale", "noise_mm"))  # type: ignore[literal-required]
    source, method = str(row["contact_source"]), str(row["method"])
    return Place(str(row["scenario"]), float(row["clearance_mm"]), human_error_scale, noise_mm, source, method)


def page(found: Mapping[Place, Sequence[TrialRecord]], half: Iterable[TrialRecord]) -> list[str]:
    trials = sum(map(len, found.values()))
    return [
        "# Round and tilted faces",
        "",
        _outcome(found),
        "",
        f"## Success at a clearance of {CLEARANCE_MM} mm",
        "",
        *table(("scenario", "human error", "noise", *(f"`{m}`" for m in METHODS), "planned error, mm"), success(found)),
        "",
        "## Less clearance",
        "",
        *table(("scenario", "clearance, mm", "noise", *(f"`{m}`" for m in TIGHTER)), tighter(found)),
        "",
        "## Detected contacts",
        "",
        _detection(found),
        "",
        f"## Errors along the ten operations of {CHAIN}",
        "",
        "No human error; medians in mm. *Planned*: distance of planned parts from their true places, in directions "
        "that contacts fix. *Final*: the same of the finished assembly of `contact`, and its distance in free "
        "directions. Last, the operation at which `uncorrected` fails.",
        "",
        *table(
            (
                *("noise", *(f"`{m}`" for m in CHAINED)),
                *("planned: `uncorrected`", "`paper`", "`contact`"),
                *("final: fixed", "free", "`uncorrected` fails at"),
            ),
            chain(found),
        ),
        "",
        "## Half the time step",
        "",
        "The same trials with 1 ms and with 0.5 ms, seed by seed.",
        "",
        *table(("scenario", "trials", "verdicts that differ"), half_step(found, half)),
        "",
        "## Measurement",
        "",
        "Written by `python benchmarks/round.py` from sweeps of `benchmarks/round.toml` and `gearbox.toml`; the counts "
        "are in `benchmarks/results/round.csv`. Success: the finished assembly is right; friction grasp, the same "
        "seeds for every method. Noise is 1 sigma per axis. `oracle` has the true poses, so neither human error nor "
        "noise changes it. Planned error: median distance of planned parts from their true places, by `uncorrected` "
        "and `contact`, in directions that contacts fix. "
        f"{widths(20, 50, 100)} {share_of_sweep(trials, *SWEEPS)}",
    ]


def _outcome(found: Mapping[Place, Sequence[TrialRecord]]) -> str:
    """Return two sentences: how often poses with noise succeed, corrected and as observed."""
    noisy = {p: rows for p, rows in found.items() if p.noise_mm >= 1.0 and p.contact_source == "given"}
    rates = {m: rate_of([row for p, own in noisy.items() if p.method == m for row in own]) for m in CHAINED}
    contact, uncorrected, spiral = (
        f"{rates[m].successes} of {rates[m].trials}" for m in ("contact", "uncorrected", "spiral-search")
    )
    return (
        f"With noise of 1 mm and 1 degree or more `contact` succeeds in {contact} trials with round and tilted parts. "
        f"The observed poses succeed in {uncorrected}, and in {spiral} with a search for holes."
    )


def success(found: Mapping[Place, Sequence[TrialRecord]]) -> Iterator[list[object]]:
    plain = {p: rows for p, rows in found.items() if (p.clearance_mm, p.contact_source) == (CLEARANCE_MM, "given")}
    for scenario in sorted({place.scenario for place in plain}):
        told = [row for p, rows in plain.items() if (p.scenario, p.method) == (scenario, "oracle") for row in rows]
        yield [scenario, "", "`oracle`", fraction(rate_of(told)), *[""] * len(METHODS)]
        for scale, noise in sorted({p[2:4] for p in plain if p.scenario == scenario and p.method != "oracle"}):
            own = {m: plain.get(Place(scenario, CLEARANCE_MM, scale, noise, "given", m), ()) for m in METHODS}
            errors = [_middle(own[m], "planned_error_fixed_mm") for m in ("uncorrected", "contact") if own[m]]
            rates = [fraction(rate_of(own[m])) for m in METHODS]
            yield [scenario, f"{scale:g}", f"{noise:g}", *rates, ", ".join(errors)]


def tighter(found: Mapping[Place, Sequence[TrialRecord]]) -> Iterator[list[object]]:
    less = {p: rows for p, rows in found.items() if p.clearance_mm < CLEARANCE_MM and p.contact_source == "given"}
    for scenario, clearance_mm, noise in sorted({(p.scenario, p.clearance_mm, p.noise_mm) for p in less}):
        own = [less.get(Place(scenario, clearance_mm, 0.0, noise, "given", method), ()) for method in TIGHTER]
        yield [scenario, f"{clearance_mm:g}", f"{noise:g}", *(fraction(rate_of(rows)) for rows in own)]


def _detection(found: Mapping[Place, Sequence[TrialRecord]]) -> str:
    """Return how often exactly the true contacts are detected, and how often `contact` succeeds with them."""
    rows = [row for place, own in found.items() if place.contact_source == "detected" for row in own]
    rate = rate_of(rows)
    return (
        "At 0.5 mm and degrees with `--contact-source detected`, over all scenarios, without and with human error: "
        f"exactly the true contacts were detected in {_detected(rows)} of {len(rows)} trials, and `contact` succeeds "
        f"in {rate.successes} of {rate.trials} with them."
    )


def chain(found: Mapping[Place, Sequence[TrialRecord]]) -> Iterator[list[object]]:
    mine = {
        (p.noise_mm, p.method): rows
        for p, rows in found.items()
        if (p.scenario, p.human_error_scale, p.contact_source) == (CHAIN, 0.0, "given")
    }
    for noise in sorted({noise for noise, _ in mine}):
        of = {method: mine.get((noise, method), ()) for method in CHAINED}
        if all(of.values()):
            planned = [_middle(of[m], "planned_error_fixed_mm") for m in ("uncorrected", "paper", "contact")]
            left = [_middle(of["contact"], name) for name in ("pose_error_fixed_mm", "pose_error_free_mm")]
            failed = [row for row in of["uncorrected"] if not row["success"]]
            rates = [fraction(rate_of(of[m])) for m in CHAINED]
            yield [f"{noise:g}", *rates, *planned, *left, _middle(failed, "failure_operation", 0)]


def half_step(found: Mapping[Place, Sequence[TrialRecord]], half: Iterable[TrialRecord]) -> Iterator[list[object]]:
    ends = {(place, row["seed"]): row["success"] for place, rows in found.items() for row in rows}
    both = [row for row in half if (place_of(row), row["seed"]) in ends]
    for name, rows in {**group(both, lambda row: row["scenario"]), "all": both}.items():
        differing = sum(row["success"] != ends[place_of(row), row["seed"]] for row in rows)
        yield [name, len(rows), f"{differing} ({100 * differing / max(1, len(rows)):.1f} %)"]


def _detected(rows: Sequence[TrialRecord]) -> int | None:
    """Count trials with exactly the true contacts; None where contacts are given."""
    if rows[0]["contact_source"] != "detected":
        return None
    return sum(row["contacts_false_negative"] == 0 and row["contacts_false_positive"] == 0 for row in rows)


def _middle(rows: Iterable[TrialRecord], column: str, digits: int = 2) -> str:
    """Return the median of a column; nothing where no trial has it."""
    numbers = [row[column] for row in rows if row[column] is not None]  # type: ignore[literal-required]
    return f"{median(numbers):.{digits}f}" if numbers else ""


if __name__ == "__main__":
    main()
