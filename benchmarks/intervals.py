"""Coverage of the intervals of tracks, and their widths: `python -m benchmarks.intervals` (minutes).

Writes docs/pictures/intervals.png and the table of docs/how/statistics.md. results/intervals.csv has scores of entries
with seeds that all conditions shared, with their intervals over seeds (empirical likelihood), and the interval that
independent trials of the same number would have.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import beta

from apo_bench.benchmark.analysis import measure_mean_difference, measure_mean_rate
from apo_bench.geometry import Array

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "pictures" / "intervals.png"
PAGE = ROOT / "docs" / "how" / "statistics.md"
WIDTHS = ROOT / "benchmarks" / "results" / "intervals.csv"
BEGIN = "<!-- written by benchmarks/intervals.py -->\n"
END = "<!-- until here: coverage -->\n"
DRAWS = 2000
RATES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)
DESIGNS = ((16, 10), (16, 30))
"""Conditions, and trials of each."""
DISCORDANT = ((0.05, 0.0), (0.15, 0.0), (0.15, 0.05), (0.15, 0.1), (0.4, 0.2))
"""Shares of pairs that end differently, and differences of the two rates."""


def spread(rate: float, conditions: int, unequal: bool) -> Array:
    """Return rates of conditions with a mean near `rate`: all equal, or those of a U-shaped Beta distribution."""
    if not unequal or rate in (0.0, 1.0):
        return np.full(conditions, rate)
    return np.asarray(beta.ppf((np.arange(conditions) + 0.5) / conditions, rate, 1.0 - rate))


def cover_rate(rates: Array, trials: int, rng: np.random.Generator) -> float:
    """Return how often the interval of the mean of some rates contains it."""
    truth = rates.mean()
    covered = 0
    for _ in range(DRAWS):
        low, high = measure_mean_rate(list((rng.random((len(rates), trials)) < rates[:, None]).astype(float))).interval
        covered += low - 1e-9 <= truth <= high + 1e-9
    return covered / DRAWS


def cover_difference(share: float, difference: float, conditions: int, trials: int, rng: np.random.Generator) -> float:
    """Return how often the interval of a difference contains it."""
    ends = np.cumsum([(share + difference) / 2.0, (share - difference) / 2.0])
    covered = 0
    for _ in range(DRAWS):
        drawn = rng.random((conditions, trials))
        apart = (drawn < ends[0]).astype(float) - ((drawn >= ends[0]) & (drawn < ends[1]))
        found = measure_mean_difference(list(apart))
        assert found is not None
        covered += found.interval.low <= difference <= found.interval.high
    return covered / DRAWS


def write_table(covered: dict[tuple[int, int, bool], list[float]], differences: dict[tuple[int, int], float]) -> None:
    """Write the table of the page."""
    lines = [
        "| conditions, trials of each | rates | 0 | 0.05 to 0.99, mean | least, most | 1 | differences, mean |",
        "|---|---|---|---|---|---|---|",
    ]
    for (conditions, trials, unequal), found in covered.items():
        first, *middle, last = (100.0 * each for each in found)
        apart = f"{100 * differences[conditions, trials]:.1f}" if not unequal else "–"
        kind = "unequal" if unequal else "equal"
        lines.append(
            f"| {conditions}, {trials} | {kind} | {first:.1f} | {np.mean(middle):.1f} | "
            f"{min(middle):.1f}, {max(middle):.1f} | {last:.1f} | {apart} |"
        )
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    table = "\n".join(lines)
    PAGE.write_text(f"{before}{BEGIN}\n{table}\n\n{END}{rest.split(END)[1]}", encoding="utf-8")


def draw(covered: dict[tuple[int, int, bool], list[float]]) -> None:
    """Draw coverage over the rate, and both intervals of each score."""
    with WIDTHS.open(encoding="utf-8") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: float(row["score"]))
    figure = Figure(figsize=(9.5, 4.2), layout="constrained")
    coverage, widths = figure.subplots(1, 2)
    for (conditions, trials, unequal), found in covered.items():
        label = f"{conditions} conditions of {trials}, {'unequal' if unequal else 'equal'}"
        coverage.plot(RATES, [100 * each for each in found], "o-" if unequal else "s--", markersize=3, label=label)
    coverage.axhline(95.0, color="0.6", linewidth=1)
    coverage.set(xlabel="rate", ylabel="coverage [%]", ylim=(90, 100.5), title="Coverage of nominal 95 %")
    coverage.legend(fontsize=7)
    for name, color, offset in (("shared", "0.65", -0.2), ("independent", "#1f5a8a", 0.2)):
        y = np.arange(len(rows)) + offset
        low, high = (np.array([float(row[f"{name}_{end}"]) for row in rows]) for end in ("low", "high"))
        widths.hlines(
            y, low, high, color=color, linewidth=1.2, label=f"{name} seeds, median {np.median(high - low):.0f}"
        )
    widths.set(xlabel="success [%]", yticks=[], title=f"{len(rows)} scores: intervals for the same number of trials")
    widths.legend(fontsize=7, loc="lower right")
    figure.savefig(PICTURE, dpi=110, metadata={"Software": None})


def main() -> None:
    rng = np.random.default_rng(54)
    covered = {
        (conditions, trials, unequal): [cover_rate(spread(rate, conditions, unequal), trials, rng) for rate in RATES]
        for conditions, trials in DESIGNS
        for unequal in (False, True)
    }
    differences = {
        design: float(np.mean([cover_difference(*kind, *design, rng) for kind in DISCORDANT])) for design in DESIGNS
    }
    write_table(covered, differences)
    draw(covered)


if __name__ == "__main__":
    main()
