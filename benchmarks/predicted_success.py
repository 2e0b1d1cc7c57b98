"""Measure the predicted success of plans: `python -m benchmarks.predicted_success FOLDER`.

Runs trials of generated assemblies and of the benchmark's scenarios, those that FOLDER lacks, and keeps each plan with
what its planner knew. The generated ones serve to develop the prediction; the others, with noise and contacts
that the package does not know (`held_out`), measure it: results/predicted_success.csv,
docs/results/predicted-success.md and its picture. `--again` predicts all kept plans again, without physics; `--page`
writes the page from the committed trials.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import pickle
from collections.abc import Iterable
from pathlib import Path

from apo_bench.scenario.scenario_file import load_scenario
from benchmarks.predicted_success_page import write_page
from benchmarks.predicted_success_trials import (
    CALIBRATION,
    HELD_OUT,
    LEARNED,
    SCENARIOS,
    TESTED,
    Line,
    Planned,
    can_be_built,
    generate,
    prediction_of,
    read_lines,
    run_conditions,
    save,
    scene_with,
)

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "predicted_success.csv"
FIRST_ASSEMBLY = 100  # `generated_rates.py` has those below
FIRST_SEED = 7001  # other benchmarks have those below


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--blocks", type=int, default=30, help="generated assemblies of blocks (30)")
    parser.add_argument("--seeds", type=int, default=8, help="seeds of every scenario of the benchmark (8)")
    parser.add_argument("--again", action="store_true", help="run nothing, predict the kept plans again")
    parser.add_argument("--page", action="store_true", help="run nothing, use the committed trials")
    given = parser.parse_args()
    if not given.page:
        if given.folder is None:
            parser.error("give the folder of the trials, or --page")
        given.folder.mkdir(parents=True, exist_ok=True)
        if not given.again:
            run(given.folder, range(FIRST_ASSEMBLY, FIRST_ASSEMBLY + given.blocks), given.seeds)
        lines = [line for path in sorted(given.folder.glob("*.pickle")) for line in predicted_again(path, given.folder)]
        KEPT.unlink(missing_ok=True)
        save(KEPT, sorted(lines, key=lambda line: (line["set"], line["scenario"], int(line["seed"]))))
    write_page(read_lines(KEPT))


def run(folder: Path, assemblies: Iterable[int], seeds: int) -> None:
    """Run the trials that the folder lacks."""
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for name in SCENARIOS:
            path = folder / f"{name}_{seed}.pickle"
            if not path.exists():
                keep(path, run_conditions(HELD_OUT, name, name, seed, TESTED))
    for number in assemblies:
        path = folder / f"blocks_{number}.pickle"
        scenario = generate(folder, "blocks", number)
        if not path.exists() and can_be_built(scenario):
            keep(path, run_conditions(CALIBRATION, path.stem, scenario, 2000 + 10 * number, LEARNED))


def keep(path: Path, plans: Iterable[Planned]) -> None:
    """Write the plans of one scenario and seed."""
    done = list(plans)
    with path.open("wb") as file:
        pickle.dump(done, file)
    print(f"{path.stem}: {sum(line['success'] == '1' for line, *_ in done)} of {len(done)} right", flush=True)


def predicted_again(path: Path, folder: Path) -> list[Line]:
    """Return the lines of kept plans with the predictions of today."""
    with path.open("rb") as file:
        plans: list[Planned] = pickle.load(file)
    lines = list[Line]()
    for planned in plans:
        name = planned.line["scenario"]
        scenario = name if name in SCENARIOS else str(folder / name / f"{name}.toml")
        play = planned.clearance_mm / load_scenario(scenario).clearance_mm
        lines.append({**planned.line, "predicted": prediction_of(planned, scene_with(scenario, round(play, 6)))})
    return lines


if __name__ == "__main__":
    main()
