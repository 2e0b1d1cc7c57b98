"""What replays take, and what a sweep took: operations beyond doing each once, simulated time, how far finished parts
were pushed; wall times of trials, and what workers did, out of `timing.jsonl`.

What robots that feel found out about themselves, beside what their errors were drawn with.
"""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any, final

import numpy as np

from apo_bench.io import each_line, grouped
from apo_bench.records import Row, look_up, robot_sigmas, told_error
from apo_bench.records.run.validation import timing_of
from apo_bench.statistics.rates import Place, by_method, order, place_of

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
    return tuple(
        Effort(
            *key,
            trials=len(own),
            extra_operations=fmean(row["extra_operations"] or 0 for row in own),
            sim_seconds=median(row["sim_seconds"] or 0.0 for row in own),
            pushed_mm=max(row["pushed_mm"] or 0.0 for row in own),
        )
        for key, own in by_method(row for row in rows if row["success"]).items()
    )


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
    seconds = {key: [float(line["trial_s"]) for line in own] for key, own in by_method(lines).items()}
    return tuple(
        TrialTimes(scenario, method, len(own), *map(float, np.percentile(own, (5, 50, 95))), sum(own))  # type: ignore[call-arg]
        for (scenario, method), own in seconds.items()
    )


def work(lines: Iterable[Mapping[str, Any]]) -> tuple[Work, ...]:
    """One per host and worker."""

    def named(line: Mapping[str, Any], key: str) -> str:
        return "" if line.get(key) is None else str(line[key])

    busy = grouped(
        ((named(line, "host"), named(line, "worker")), sum(float(line.get(part) or 0.0) for part in _PARTS))
        for line in lines
    )
    return tuple(Work(host, worker, len(own), sum(own)) for (host, worker), own in sorted(busy.items()))


@final
@dataclass(frozen=True)
class FeltSummary:
    """Of the trials of a cell in which a robot felt; lengths are root mean squares of vectors, angles alike."""

    place: Place
    trials: int
    touches: float
    """Mean."""
    refused: int
    """Touches that were not believed, all together."""
    felt_mm: float
    felt_deg: float
    """How far the base was believed to be off in the end."""
    sure_mm: float
    sure_deg: float
    """How far that may be wrong, as the robot says itself."""

    @property
    def drawn(self) -> tuple[float, float]:
        """What the true error was drawn with, [mm] and [deg]."""
        return _as_vector(self.place.robot_error)

    @property
    def told(self) -> tuple[float, float] | None:
        """What the robot was told, [mm] and [deg]; None if nothing."""
        said = told_error(self.place.stated_error, self.place.robot_error)
        return None if said is None else _as_vector(said)


def felt(rows: Iterable[Row]) -> tuple[FeltSummary, ...]:
    """One per cell of a method that feels, sorted as `tally` sorts."""
    groups = grouped((place, row) for row in rows if row.get("touches") is not None and (place := place_of(row)))
    return tuple(_summary(place, groups[place]) for place in sorted(groups, key=order))


def _summary(place: Place, rows: Sequence[Row]) -> FeltSummary:
    def column(name: str) -> list[float]:
        return [float(look_up(row, name)) for row in rows]

    sizes = (_root_mean_square(column(name)) for name in ("felt_mm", "felt_deg", "felt_sure_mm", "felt_sure_deg"))
    touches = math.fsum(column("touches")) / len(rows)
    return FeltSummary(place, len(rows), touches, int(sum(column("touches_refused"))), *sizes)


def _root_mean_square(sizes: Sequence[float]) -> float:
    return math.sqrt(math.fsum(x * x for x in sizes) / len(sizes))


def _as_vector(name: str) -> tuple[float, float]:
    """Root mean squares of vectors of three axes, of where hand and eye believe each other."""
    mm, deg = robot_sigmas(name).hand_eye
    return math.sqrt(3.0) * mm, math.sqrt(3.0) * deg
