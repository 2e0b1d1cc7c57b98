"""What replays take, and what a sweep took: operations beyond doing each once, simulated time, how far finished parts
were pushed; wall times of trials, and what workers did, out of `timing.jsonl`."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any, final

import numpy as np

from apo_bench.io.ordinary_files import each_line
from apo_bench.records import Row
from apo_bench.records.run.validation import timing_of
from apo_bench.statistics.rates import by_method

_PARTS = ("compile_s", "demonstrate_s", "trial_s")


@final
@dataclass(frozen=True)
class Effort:
    """Over every level and carelessness of a sweep, of the trials that were a success."""

    scenario: str
    method: str
    trials: int
    extra_operations: float
    """Mean."""
    sim_seconds: float
    """Median."""
    pushed_mm: float
    """Largest."""


@final
@dataclass(frozen=True)
class TrialTimes:
    """Wall times of the trials of a scenario by a method, demonstration and compilation left out, [s]."""

    scenario: str
    method: str
    trials: int
    low: float
    median: float
    high: float
    """The 5th, 50th and 95th percentile."""
    total: float


@final
@dataclass(frozen=True)
class Work:
    """What a worker did."""

    host: str
    worker: str
    trials: int
    busy_s: float

    @property
    def rows_per_minute(self) -> float:
        return 60.0 * self.trials / self.busy_s if self.busy_s > 0 else 0.0


def efforts(rows: Iterable[Row]) -> tuple[Effort, ...]:
    """One per scenario and method that had a success, sorted as `tally` sorts."""
    groups = by_method(row for row in rows if row["success"])
    return tuple(_effort(*key, own) for key, own in groups.items())


def read_timing(folder: Path) -> list[dict[str, Any]]:
    """The lines of trials that were timed; none if there is no such file.

    Raises:
        InputError: The file cannot be read, or a line is none; one sentence with file, line and field.
    """
    path = folder / "timing.jsonl"
    if not os.path.lexists(path):
        return []
    lines = [timing_of(line, f"{path}, line {number}") for number, line in each_line(path, "table of timings")]
    return [line for line in lines if line["trial_s"] is not None]


def trial_times(lines: Iterable[Mapping[str, Any]]) -> tuple[TrialTimes, ...]:
    """One per scenario and method, sorted as `tally` sorts."""
    groups = by_method(lines)
    return tuple(_times(*key, [float(line["trial_s"]) for line in own]) for key, own in groups.items())


def work(lines: Iterable[Mapping[str, Any]]) -> tuple[Work, ...]:
    """One per host and worker."""
    groups: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        busy = sum(float(line.get(part) or 0.0) for part in _PARTS)
        host, worker = ("" if line.get(key) is None else str(line[key]) for key in ("host", "worker"))
        groups.setdefault((host, worker), []).append(busy)
    return tuple(Work(*key, len(groups[key]), sum(groups[key])) for key in sorted(groups))


def _effort(scenario: str, method: str, rows: Sequence[Row]) -> Effort:
    return Effort(
        scenario=scenario,
        method=method,
        trials=len(rows),
        extra_operations=fmean(row["extra_operations"] or 0 for row in rows),
        sim_seconds=median(row["sim_seconds"] or 0.0 for row in rows),
        pushed_mm=max(row["pushed_mm"] or 0.0 for row in rows),
    )


def _times(scenario: str, method: str, seconds: Sequence[float]) -> TrialTimes:
    low, middle, high = map(float, np.percentile(seconds, (5, 50, 95)))
    return TrialTimes(scenario, method, len(seconds), low, middle, high, float(sum(seconds)))
