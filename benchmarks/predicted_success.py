"""Calibrate the predicted success of plans, and measure it: `python -m benchmarks.predicted_success FOLDER`.

Runs trials of generated assemblies and of the benchmark's scenarios, those that FOLDER lacks, and saves each with its
score. Isotonic regression of the generated ones makes the table `apo_bench/trial/predicted_success_table.py`. The
others, which the table has never seen, measure it: docs/results/predicted-success.md, its picture, and
results/predicted_success.csv, from which `--page` writes all of it without a trial.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression

from apo_bench.geometry import Array
from benchmarks.predicted_success_page import write_page
from benchmarks.predicted_success_trials import (
    CALIBRATION,
    Line,
    read_lines,
    run_calibration,
    run_held_out,
    save,
)

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "predicted_success.csv"
TABLE = ROOT / "apo_bench" / "trial" / "predicted_success_table.py"
FIRST_ASSEMBLY = 100  # `generated_rates.py` has those below
FIRST_SEED = 3000  # other benchmarks have those below
GROUP = 25  # trials of neighbouring scores that are counted together


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--blocks", type=int, default=100, help="generated assemblies of blocks (100)")
    parser.add_argument("--round", type=int, default=4, help="generated assemblies with round parts (4)")
    parser.add_argument("--seeds", type=int, default=10, help="seeds of every scenario of the benchmark (10)")
    parser.add_argument("--page", action="store_true", help="run nothing, use the committed trials")
    given = parser.parse_args()
    if not given.page:
        if given.folder is None:
            parser.error("give the folder of the trials, or --page")
        given.folder.mkdir(parents=True, exist_ok=True)
        run(given.folder, {"blocks": given.blocks, "generated": given.round}, given.seeds)
    lines = read_lines(KEPT)
    scores, rates = calibrate([line for line in lines if line["set"] == CALIBRATION])
    write_table(scores, rates)
    write_page(lines, scores, rates)


def run(folder: Path, assemblies: dict[str, int], seeds: int) -> None:
    """Run the trials that the folder lacks, and commit all in their order."""
    path = folder / "trials.csv"
    known = read_lines(path)
    for kind, count in assemblies.items():
        for lines in run_calibration(folder, kind, range(FIRST_ASSEMBLY, FIRST_ASSEMBLY + count), known):
            save(path, lines)
    for lines in run_held_out(range(FIRST_SEED, FIRST_SEED + seeds), known):
        save(path, lines)
    KEPT.unlink(missing_ok=True)
    save(KEPT, sorted(read_lines(path), key=lambda line: (line["set"], line["scenario"], int(line["seed"]))))


def write_table(scores: Array, rates: Array) -> None:
    """Write the module that the package reads."""
    text = TABLE.read_text(encoding="utf-8").split("SCORES =")[0]
    for name, numbers in (("SCORES", scores), ("RATES", rates)):
        lines = "".join(f"    {x:.4f},\n" for x in numbers)
        text += f"{name} = (\n{lines})\n"
    TABLE.write_text(text, encoding="utf-8")
    print(f"Wrote {TABLE}")


def calibrate(lines: Sequence[Line]) -> tuple[Array, Array]:
    """Return scores, rising, and how often plans with such a score succeeded, not falling.

    Each group of neighbouring scores gets half a trial of either outcome, so that no rate is 0 or 1.
    """
    known = sorted((float(line["score"]), int(line["success"])) for line in lines if line["score"])
    groups = np.array_split(np.array(known), max(1, len(known) // GROUP))
    counts = np.array([float(len(group)) for group in groups])
    scores = np.array([group[:, 0].mean() for group in groups])
    rates = np.array([(group[:, 1].sum() + 0.5) / (len(group) + 1.0) for group in groups])
    found = isotonic_regression(rates, weights=counts)
    starts = found.blocks[:-1]
    return np.add.reduceat(scores * counts, starts) / np.add.reduceat(counts, starts), found.x[starts]


if __name__ == "__main__":
    main()
