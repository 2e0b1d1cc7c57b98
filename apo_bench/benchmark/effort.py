"""What replays take: operations beyond doing each once, simulated time, and how far finished parts were pushed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any, final

from apo_bench.benchmark.page.markup import Table
from apo_bench.benchmark.statistics import rank

WORDS = (
    "Of trials that were right: the operations that were undone and done again, the simulated time, and how far a part "
    "that was in place was pushed at most."
)


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


def efforts(rows: Iterable[Mapping[str, Any]]) -> tuple[Effort, ...]:
    """One per scenario and method that had a success, sorted as `tally` sorts."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["success"]:
            groups.setdefault((row["scenario"], row["method"]), []).append(row)
    order = sorted(groups, key=lambda key: (key[0], rank(key[1]), key[1]))
    return tuple(_effort(*key, groups[key]) for key in order)


def effort_table(found: Sequence[Effort]) -> Table:
    """For people."""
    head = ("scenario", "method", "right", "extra operations", "simulated", "pushed at most")
    rows: list[tuple[object, ...]] = [
        (e.scenario, e.method, e.trials, f"{e.extra_operations:.1f}", f"{e.sim_seconds:.0f} s", f"{e.pushed_mm:.2f} mm")
        for e in found
    ]
    return Table(head, rows, words=2)


def _effort(scenario: str, method: str, rows: Sequence[Mapping[str, Any]]) -> Effort:
    return Effort(
        scenario=scenario,
        method=method,
        trials=len(rows),
        extra_operations=fmean(row["extra_operations"] for row in rows),
        sim_seconds=median(row["sim_seconds"] for row in rows),
        pushed_mm=max((row["pushed_mm"] or 0.0 for row in rows), default=0.0),
    )
