"""What promises are worth: `python -m benchmarks.promise FOLDER [--blocks 100] [--round 4] [--seeds 10]`.

Runs trials of generated assemblies and of the benchmark's scenarios, whatever of them is not in FOLDER yet, and saves
each with its score. From the generated ones the table `apo_bench/trial/promise_table.py` is made, by isotonic
regression; the others, which it never saw, say what it is worth: docs/results/promise.md, its picture, and
results/promise.csv, from which `--page` makes all of it again without a trial.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from apo_bench.geometry import Array
from benchmarks.promise_page import write_page
from benchmarks.promise_trials import (
    CALIBRATION,
    Line,
    calibration_trials,
    held_out_trials,
    lines_of,
    save,
)

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "promise.csv"
TABLE = ROOT / "apo_bench" / "trial" / "promise_table.py"
FIRST = 100
"""Number of the first generated assembly: those below are of `generated_rates.py`."""
FIRST_SEED = 3000
"""Of the benchmark's scenarios: those below are of other benchmarks."""
BIN = 25
"""Trials of neighbouring scores that are counted together before isotonic regression."""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path, nargs="?")
    asked.add_argument("--blocks", type=int, default=100, help="generated assemblies of blocks")
    asked.add_argument("--round", type=int, default=4, help="generated assemblies with round parts")
    asked.add_argument("--seeds", type=int, default=10, help="of every scenario of the benchmark")
    asked.add_argument("--page", action="store_true", help="run nothing, use the trials that are kept")
    given = asked.parse_args()
    if not given.page:
        if given.folder is None:
            asked.error("give the folder of the trials, or --page")
        given.folder.mkdir(parents=True, exist_ok=True)
        run(given.folder, given.blocks, given.round, given.seeds)
    lines = lines_of(KEPT)
    scores, rates = table([line for line in lines if line["set"] == CALIBRATION])
    write_table(scores, rates)
    write_page(lines, scores, rates)


def run(folder: Path, blocks: int, round_ones: int, seeds: int) -> None:
    """Run what is not saved yet, and keep all trials in their order."""
    path = folder / "trials.csv"
    known = lines_of(path)
    for kind, count in (("blocks", blocks), ("generated", round_ones)):
        numbers = range(FIRST, FIRST + count)
        for lines in calibration_trials(folder, kind, numbers, known):
            save(path, lines)
    for lines in held_out_trials(range(FIRST_SEED, FIRST_SEED + seeds), known):
        save(path, lines)
    KEPT.unlink(missing_ok=True)
    save(KEPT, sorted(lines_of(path), key=lambda line: (line["set"], line["scenario"], int(line["seed"]))))


def write_table(scores: Array, rates: Array) -> None:
    """Write the module that the package reads."""
    head = TABLE.read_text(encoding="utf-8").split("SCORES =")[0]
    columns = (("SCORES", scores), ("RATES", rates))
    made = [f"{name} = (\n{''.join(f'    {x:.4f},{chr(10)}' for x in numbers)})\n" for name, numbers in columns]
    TABLE.write_text(head + "".join(made), encoding="utf-8")
    print(f"Wrote {TABLE}")


def table(lines: Sequence[Line]) -> tuple[Array, Array]:
    """Scores, rising, and how often plans with such a score succeeded, not falling."""
    known = sorted((float(line["score"]), int(line["success"])) for line in lines if line["score"])
    groups = np.array_split(np.array(known), max(1, len(known) // BIN))
    scores = [float(group[:, 0].mean()) for group in groups]
    counts = [float(len(group)) for group in groups]
    # half a trial of either kind is added to each group, so that nothing is said to be certain
    rates = [(float(group[:, 1].sum()) + 0.5) / (len(group) + 1.0) for group in groups]
    return pooled(scores, rates, counts)


def pooled(scores: Sequence[float], rates: Sequence[float], counts: Sequence[float]) -> tuple[Array, Array]:
    """Pool adjacent violators: neighbours whose rates fall are counted together (Barlow et al., 1972)."""
    pools: list[Array] = []
    for entry in zip(scores, rates, counts, strict=True):
        pools.append(np.array(entry))
        while len(pools) > 1 and pools[-2][1] >= pools[-1][1]:
            last = pools.pop()
            weight = pools[-1][2] + last[2]
            mean = (pools[-1][:2] * pools[-1][2] + last[:2] * last[2]) / weight
            pools[-1] = np.array([*mean, weight])
    return tuple(np.array(pools)[:, :2].T)


if __name__ == "__main__":
    main()
