"""What replays take: operations beyond doing each once, simulated time, and how far finished parts were pushed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import final

from apo_bench.records.row import Row
from apo_bench.statistics.rates import by_method


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


def efforts(rows: Iterable[Row]) -> tuple[Effort, ...]:
    """One per scenario and method that had a success, sorted as `tally` sorts."""
    groups = by_method(row for row in rows if row["success"])
    return tuple(_effort(*key, own) for key, own in groups.items())


def _effort(scenario: str, method: str, rows: Sequence[Row]) -> Effort:
    return Effort(
        scenario=scenario,
        method=method,
        trials=len(rows),
        extra_operations=fmean(row["extra_operations"] or 0 for row in rows),
        sim_seconds=median(row["sim_seconds"] or 0.0 for row in rows),
        pushed_mm=max((row["pushed_mm"] or 0.0 for row in rows), default=0.0),
    )
