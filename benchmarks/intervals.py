"""How often do the intervals of a report hold the truth? `python benchmarks/intervals.py [WORKERS [EXPERIMENTS]]`
(10,000 experiments per setting, of those that take long a fifth: some minutes on two cores).

Sweeps are drawn from known rates, 0.05 to 0.95, with 50, 100 and 200 seeds, and the 95 % intervals are computed by the
functions that reports use. `benchmarks/results/coverage.csv` has one line per setting, and the tables in
`docs/how/statistics.md` are written anew. Every setting has its own stream of chance, so the result does not depend on
the number of processes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import csv
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, ndtr, ndtri

from apo_bench.benchmark.analysis import mean_surprise, tango, threshold, wilson
from apo_bench.benchmark.analysis.half_level import sure

LONG = ("mean over seeds", "sure bounds")
SEEDS = (50, 100, 200)
RATES = tuple(round(0.05 * i, 2) for i in range(1, 20))
LEVELS = np.array([0.1, 0.25, 0.5, 1.0, 2.0, 4.0])
WEIGHTS = np.convolve(np.diff(np.log(LEVELS)), (0.5, 0.5)) / np.log(LEVELS[-1] / LEVELS[0])
"""Of trapezoids over the logarithm of the level: the mean over levels that a seed gives."""
PLACES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Of the half level between the second level and the last but one."""
ALIKE = (0.0, 0.5, 0.9)
"""How alike two methods or levels end at a seed: 0 by chance alone, 1 as alike as their rates allow."""
SHAPES = tuple(product(("logistic", "lapses", "normal", "early", "late"), (2.0, 6.0)))
"""Of curves that have a half level, and their steepness; `early` ones leave the ceiling early, `late` ones late."""
HERE = Path(__file__).parent
TABLE = HERE / "results" / "coverage.csv"
PAGE = HERE.parent / "docs" / "how" / "statistics.md"
BEGIN = "<!-- tables: python benchmarks/intervals.py -->"
END = "<!-- end of tables -->"


class Setting(NamedTuple):
    """What is drawn; `rate` is the true rate, the method's, the mean, or the place of the half level."""

    interval: str
    seeds: int
    rate: float
    other: float
    """Rate of the reference, share of the seeds, steepness, number of the shape: as the interval has it."""
    alike: float


def settings() -> Iterator[Setting]:
    """Every setting of the study."""
    for n, rate in product(SEEDS, RATES):
        yield Setting("rate", n, rate, 1.0, 0.0)
        for share in (0.5, 0.7, 0.9):
            yield Setting("share", n, rate, share, 0.0)
        for reference, alike in product(PLACES, ALIKE):
            yield Setting("difference", n, rate, reference, alike)
        for steep in (1.0, 3.0):
            yield Setting("mean over seeds", n, rate, steep, 0.8)
        for shape in range(len(SHAPES)) if rate in PLACES[::2] else ():
            yield Setting("sure bounds", n, rate, shape, 0.8)


def coverage(number: int, setting: Setting, experiments: int) -> float:
    """The share of the experiments whose interval holds the truth."""
    rng = np.random.default_rng([6, number])
    return float(np.mean(STUDIES[setting.interval](setting, size(setting, experiments), rng)))


def size(setting: Setting, experiments: int) -> int:
    return max(1, experiments // 5) if setting.interval in LONG else experiments


def rate(s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    return held(rng.binomial(s.seeds, s.rate, count), np.full(count, s.seeds), s.rate)


def share(s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    """A rate among a random part of the seeds: recovery, harm, success among executed trials."""
    among = rng.binomial(s.seeds, s.other, count)
    return held(rng.binomial(among, s.rate), among, s.rate)


def held(successes: np.ndarray, trials: np.ndarray, truth: float) -> np.ndarray:
    ends = np.array([known_wilson(k, n) for k, n in zip(successes.tolist(), trials.tolist(), strict=True)])
    return (ends[:, 0] <= truth) & (truth <= ends[:, 1])


def difference(s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    counts = rng.multinomial(s.seeds, four(s.rate, s.other, s.alike), count)
    ends = np.array([known_tango(b, c, s.seeds) for _, c, b, _ in counts.tolist()])
    return (ends[:, 0] <= s.rate - s.other) & (s.rate - s.other <= ends[:, 1])


def mean_over_seeds(s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    p = falling(s.rate, s.other)
    right = np.round(drawn(p, s, count, rng) @ WEIGHTS, 12)
    return mean_surprise(right, np.ones_like(right), np.full(count, p @ WEIGHTS)) <= threshold(s.seeds)


def sure_bounds(s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    right = drawn(shaped(s), s, count, rng)
    noise_level = middle(s)
    over, under = sure(right.sum(axis=1), np.full((count, len(LEVELS)), s.seeds))
    return (np.r_[0.0, LEVELS][over] <= noise_level) & (noise_level <= np.r_[LEVELS, np.inf][len(LEVELS) - under])


def drawn(curve: np.ndarray, s: Setting, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, seeds, levels) successes: a seed has its own luck, alike at all levels."""
    luck = rng.standard_normal((count, s.seeds, 1))
    mixed = np.sqrt(s.alike) * luck + np.sqrt(1 - s.alike) * rng.standard_normal((count, s.seeds, len(LEVELS)))
    return np.asarray(mixed < ndtri(curve))


def four(p: float, q: float, alike: float) -> list[float]:
    """How often neither, the second alone, the first alone and both are right."""
    both = (1 - alike) * p * q + alike * min(p, q)
    return [max(0.0, x) for x in (1 - p - q + both, q - both, p - both, both)]


@cache
def falling(mean: float, steep: float) -> np.ndarray:
    """Success at the levels, logistic over the logarithm of the level, of a given mean."""
    at = brentq(lambda x: expit(steep * (x - np.log(LEVELS))) @ WEIGHTS - mean, -60.0, 60.0)
    return np.asarray(expit(steep * (at - np.log(LEVELS))))


def shaped(s: Setting) -> np.ndarray:
    """Success at the levels, by a curve of a known half level."""
    name, steep = SHAPES[int(s.other)]
    z = steep * np.log(middle(s) / LEVELS)
    if name == "logistic":
        return np.asarray(expit(z))
    if name == "lapses":
        return np.asarray(0.95 * expit(z - np.log(0.9)))
    if name == "normal":
        return np.asarray(ndtr(0.6 * z))
    return np.asarray(2.0 ** -np.exp(-0.7 * z) if name == "early" else 1.0 - 2.0 ** -np.exp(0.7 * z))


def middle(s: Setting) -> float:
    """The half level: the rate says how far along between the second level and the last but one."""
    return float(LEVELS[1] * (LEVELS[-2] / LEVELS[1]) ** s.rate)


STUDIES = {
    "rate": rate,
    "share": share,
    "difference": difference,
    "mean over seeds": mean_over_seeds,
    "sure bounds": sure_bounds,
}
known_wilson = cache(wilson)
known_tango = cache(tango)


def main(workers: int = 2, experiments: int = 10_000) -> None:
    asked = list(settings())
    with ProcessPoolExecutor(workers) as pool:
        found = list(pool.map(partial(coverage, experiments=experiments), range(len(asked)), asked, chunksize=16))
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*Setting._fields, "experiments", "coverage"])
        writer.writerows([*s, size(s, experiments), f"{c:.4f}"] for s, c in zip(asked, found, strict=True))
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    lines = tables(asked, found, experiments)
    PAGE.write_text("\n".join([before + BEGIN, *lines, END + rest.partition(END)[2]]), encoding="utf-8")
    print("\n".join(lines))


def tables(asked: list[Setting], found: list[float], experiments: int) -> list[str]:
    """Mean coverage of each interval, then rate by rate."""

    def percent(name: str, n: int, of_rate: float | None = None) -> str:
        of = [c for s, c in zip(asked, found, strict=True) if s[:2] == (name, n) and of_rate in (s.rate, None)]
        return f"{100 * np.mean(of):.1f}" if of else "–"

    def extremes(name: str) -> str:
        of = [c for s, c in zip(asked, found, strict=True) if s.interval == name]
        made = len(of) * size(Setting(name, 0, 0.0, 0.0, 0.0), experiments)
        return f"{made:,} | {100 * np.mean(of):.1f} | {100 * min(of):.1f} to {100 * max(of):.1f}"

    heads = " | ".join(f"n = {n}" for n in SEEDS)
    whole = [f"| {name} | {' | '.join(percent(name, n) for n in SEEDS)} | {extremes(name)} |" for name in STUDIES]
    names = [name for name in STUDIES if name != "sure bounds"]
    single = [
        f"| {r:.2f} | " + " | ".join(" / ".join(percent(name, n, r) for n in SEEDS) for name in names) + " |"
        for r in RATES
    ]
    single = [line.replace(" / ".join("–" * len(SEEDS)), "–") for line in single]
    return [
        "",
        "Coverage in %, mean over the settings; `settings` are the lowest and the highest single one:",
        "",
        f"| interval | {heads} | experiments | all | settings |",
        "|" + "---|" * (len(SEEDS) + 4),
        *whole,
        "",
        f"Rate by rate, mean over the other parameters, {' / '.join(str(n) for n in SEEDS)} seeds:",
        "",
        "| rate | " + " | ".join(names) + " |",
        "|" + "---|" * (len(names) + 1),
        *single,
        "",
    ]


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
