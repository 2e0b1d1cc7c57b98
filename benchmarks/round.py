"""Keep how often round and tilted parts fit: `python benchmarks/round.py FOLDER [FOLDER ...] [--half HALF ...]`.

Takes sweeps of benchmarks/round.toml and gearbox.toml, whole or not, and of the same with half the time step; writes
results/round.csv, one line for each cell, and docs/results/round.md: success with Wilson's 95 % intervals, contacts
that were recognised, and how many verdicts half the step changes.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.benchmark.analysis import wilson
from apo_bench.records import TrialRecord
from apo_bench.records.run.run_folder import read_records
from benchmarks.asked import ROUND, block
from benchmarks.made_with import mujoco_of, with_mujoco

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "round.csv"
PAGE = ROOT / "docs" / "results" / "round.md"
METHODS = ("oracle", "uncorrected", "spiral-search", "nominal", "snap", "snap+spiral", "paper", "contact")
CHAINED = ("uncorrected", "spiral-search", "paper", "contact")
"""Methods of the table of one long chain."""
PLAY = ("oracle", "uncorrected", "spiral-search", "contact")
"""Methods of the table of less play."""
DETECTED = "detected"
CHAIN = "gearbox"
"""Ten operations, one on the other."""
LEVELS = (0.0, 1.0, 2.0)
"""Of every method; the levels between are in a table of their own."""
SHOWN = "0.25"
"""Play of the scenarios, in mm."""


class Place(NamedTuple):
    """One cell."""

    scenario: str
    clearance_mm: float
    human_error_scale: float
    noise_level: float
    contact_source: str
    method: str


class Cell(NamedTuple):
    trials: int
    successes: int
    all_contacts_right: int | None
    error_mm: float
    """Median of how far corners of parts were planned wrong, along what contacts fix."""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folders", nargs="+", type=Path)
    asked.add_argument("--half", nargs="*", default=[], type=Path, help="sweeps with half the time step")
    given = asked.parse_args()
    rows = judged(given.folders)
    half = judged(given.half)
    cells = {place: cell_of(each) for place, each in grouped(rows).items()}
    with KEPT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Place._fields, *Cell._fields])
        writer.writerows([*place, *cell] for place, cell in sorted(cells.items()))
    written = "\n".join(page(cells, rows, half)) + "\n"
    PAGE.write_text(with_mujoco(written, mujoco_of([*given.folders, *given.half])), encoding="utf-8")
    print(f"Wrote {KEPT} and {PAGE}")


def judged(folders: Iterable[Path]) -> list[TrialRecord]:
    """Rows with a verdict, each trial once."""
    rows = {(place_of(row), row["seed"]): row for folder in folders for row in read_records(folder)}
    return [row for row in rows.values() if row["success"] is not None]


def grouped(rows: Iterable[TrialRecord]) -> dict[Place, list[TrialRecord]]:
    found: dict[Place, list[TrialRecord]] = defaultdict(list)
    for row in rows:
        found[place_of(row)].append(row)
    return found


def place_of(row: TrialRecord) -> Place:
    numbers = (float(row[name] or 0.0) for name in ("clearance_mm", "human_error_scale", "noise_mm"))  # type: ignore[literal-required]
    return Place(str(row["scenario"]), *numbers, str(row["contact_source"]), str(row["method"]))


def cell_of(rows: list[TrialRecord]) -> Cell:
    errors = [row["planned_error_fixed_mm"] for row in rows if row["planned_error_fixed_mm"] is not None]
    right = None
    if rows[0]["contact_source"] == DETECTED:
        right = sum(row["contacts_false_negative"] == 0 and row["contacts_false_positive"] == 0 for row in rows)
    return Cell(len(rows), sum(bool(row["success"]) for row in rows), right, round(median(errors or [0.0]), 3))


def page(cells: Mapping[Place, Cell], rows: list[TrialRecord], half: list[TrialRecord]) -> list[str]:
    return [
        "# Round and tilted faces",
        "",
        "Written by `python benchmarks/round.py` from sweeps of `benchmarks/round.toml` and `gearbox.toml`; counts in "
        "`benchmarks/results/round.csv`. Success: the finished assembly is right; Wilson's 95 % intervals; friction "
        "grasp, the same seeds for every method. A level of L is a standard deviation of L mm and L degrees per axis. "
        "`oracle` is told the true poses, so that neither human nor level changes what it does. Planned wrong by: how "
        "far, in the median, `none` and `contact` planned parts from where they belong, along what contacts fix.",
        "",
        block(ROUND),
        "",
        f"## Success at a play of {SHOWN} mm",
        "",
        *success_table(cells),
        "",
        "## Less play",
        "",
        *play_table(cells),
        "",
        "## Contacts found in the seen poses",
        "",
        "At level 0.5, `--contact-source detected`: trials in which every contact was found and no other, and success of "
        "`contact` with what was found.",
        "",
        *recognition_table(cells),
        "",
        f"## {CHAIN}: what ten operations do to errors",
        "",
        "A careful human. In mm, in the median: how far corners of parts were planned from where they belong, along "
        "what contacts fix; and how far off `contact` left parts, along what contacts fix and along what they leave "
        "free, such as where on the table the base stands. Last, the operation at which `none` fails (median).",
        "",
        *chain_table(rows),
        "",
        "## Half the time step",
        "",
        "The same trials with 1 ms and with 0.5 ms, seed by seed.",
        "",
        *half_table(rows, half),
    ]


def success_table(cells: Mapping[Place, Cell]) -> list[str]:
    plain = {p: c for p, c in cells.items() if p.clearance_mm == float(SHOWN) and p.contact_source == "given"}
    lines = sorted({(p.scenario, p.human_error_scale, p.noise_level) for p in plain if p.method != "oracle"})
    lines = [line for line in lines if line[0] != CHAIN or line[2] in LEVELS]
    made = [
        f"| scenario | human | level | {' | '.join(f'`{m}`' for m in METHODS[1:])} | planned wrong by, mm |",
        "|---|" + "---|" * (len(METHODS) + 2),
    ]
    for scenario in sorted({p.scenario for p in plain}):
        told = [c for p, c in plain.items() if p.scenario == scenario and p.method == "oracle"]
        made.append(f"| {scenario} | `oracle` | | {rate(sum_of(told))}{' |' * len(METHODS)}")
        for _, human_error_scale, noise_level in (line for line in lines if line[0] == scenario):
            each = {
                m: plain.get(Place(scenario, float(SHOWN), human_error_scale, noise_level, "given", m)) for m in METHODS
            }
            said = " | ".join(rate(each[m]) for m in METHODS[1:])
            wrong = ", ".join(f"{found.error_mm:.2f}" for m in ("uncorrected", "contact") if (found := each[m]))
            made.append(f"| {scenario} | {human(human_error_scale)} | {noise_level:g} | {said} | {wrong} |")
    return made


def play_table(cells: Mapping[Place, Cell]) -> list[str]:
    made = [
        "| scenario | play, mm | level | `oracle` | `none` | `search` | `contact` |",
        "|---|---|---|---|---|---|---|",
    ]
    less = {p: c for p, c in cells.items() if p.clearance_mm < float(SHOWN) and p.contact_source == "given"}
    for scenario, play, noise_level in sorted({(p.scenario, p.clearance_mm, p.noise_level) for p in less}):
        each = (Place(scenario, play, 0.0, noise_level, "given", method) for method in PLAY)
        made.append(
            f"| {scenario} | {play:g} | {noise_level:g} | {' | '.join(rate(less.get(place)) for place in each)} |"
        )
    return made


def recognition_table(cells: Mapping[Place, Cell]) -> list[str]:
    made = ["| scenario | human | every contact right | success |", "|---|---|---|---|"]
    for place, cell in sorted(cells.items()):
        if cell.all_contacts_right is not None:
            right = rate(Cell(cell.trials, cell.all_contacts_right, None, 0.0))
            made.append(f"| {place.scenario} | {human(place.human_error_scale)} | {right} | {rate(cell)} |")
    return made


def chain_table(rows: Iterable[TrialRecord]) -> list[str]:
    made = [
        "| level | `none` | `search` | `paper` | `contact` | planned: `none` | `paper` | `contact` | left off: fixed "
        "| free | `none` fails at |",
        "|---|" + "---|" * 10,
    ]
    mine = [
        row
        for row in rows
        if (row["scenario"], row["human_error_scale"], row["contact_source"]) == (CHAIN, 0.0, "given")
    ]
    for noise_level in sorted({float(row["noise_mm"] or 0.0) for row in mine}):
        of = {m: [row for row in mine if row["method"] == m and row["noise_mm"] == noise_level] for m in CHAINED}
        if all(of.values()):
            planned = [
                middle(row["planned_error_fixed_mm"] for row in of[m]) for m in ("uncorrected", "paper", "contact")
            ]
            ends = [
                middle(row[name] for row in of["contact"]) for name in ("pose_error_fixed_mm", "pose_error_free_mm")
            ]
            failed = [row["failure_operation"] for row in of["uncorrected"] if not row["success"]]
            said = [f"{noise_level:g}", *(rate(cell_of(of[m])) for m in CHAINED), *planned, *ends, middle(failed, 0)]
            made.append(f"| {' | '.join(said)} |")
    return made


def middle(numbers: Iterable[float | None], digits: int = 2) -> str:
    told = [number for number in numbers if number is not None]
    return f"{median(told):.{digits}f}" if told else ""


def half_table(rows: list[TrialRecord], half: list[TrialRecord]) -> list[str]:
    ends = {(place_of(row), row["seed"]): bool(row["success"]) for row in rows}
    pairs: dict[str, list[bool]] = defaultdict(list)
    for row in half:
        if (key := (place_of(row), row["seed"])) in ends:
            pairs[key[0].scenario].append(ends[key] != bool(row["success"]))
    pairs["all"] = [differs for each in pairs.values() for differs in each]
    return [
        "| scenario | trials | verdicts that differ |",
        "|---|---|---|",
        *(
            f"| {name} | {len(each)} | {sum(each)} ({100 * sum(each) / max(1, len(each)):.1f} %) |"
            for name, each in pairs.items()
        ),
    ]


def sum_of(cells: list[Cell]) -> Cell | None:
    return Cell(sum(c.trials for c in cells), sum(c.successes for c in cells), None, 0.0) if cells else None


def rate(cell: Cell | None) -> str:
    if cell is None:
        return ""
    low, high = wilson(cell.successes, cell.trials)
    return f"{cell.successes} of {cell.trials} ({100 * low:.0f} to {100 * high:.0f} %)"


def human(human_error_scale: float) -> str:
    return "human_error_scale" if human_error_scale else "careful"


if __name__ == "__main__":
    main()
