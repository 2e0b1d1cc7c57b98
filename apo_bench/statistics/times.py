"""What a sweep took: wall times of trials, and what its workers did, out of `timing.jsonl`."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.io.reading import each_line
from apo_bench.records.run.checked import timing_of
from apo_bench.statistics.rates import by_method

_PARTS = ("compile_s", "demonstrate_s", "trial_s")


@final
@dataclass(frozen=True)
class Times:
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


def times(lines: Iterable[Mapping[str, Any]]) -> tuple[Times, ...]:
    """One per scenario and method, sorted as `tally` sorts."""
    groups = by_method(lines)
    return tuple(_times(*key, [float(line["trial_s"]) for line in own]) for key, own in groups.items())


def work(lines: Iterable[Mapping[str, Any]]) -> tuple[Work, ...]:
    """One per host and worker."""
    groups: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        busy = sum(float(line.get(part) or 0.0) for part in _PARTS)
        groups.setdefault((_known(line.get("host")), _known(line.get("worker"))), []).append(busy)
    return tuple(Work(*key, len(groups[key]), sum(groups[key])) for key in sorted(groups))


def _times(scenario: str, method: str, seconds: Sequence[float]) -> Times:
    low, median, high = map(float, np.percentile(seconds, (5, 50, 95)))
    return Times(scenario, method, len(seconds), low, median, high, float(sum(seconds)))


def _known(x: object) -> str:
    return "" if x is None else str(x)
