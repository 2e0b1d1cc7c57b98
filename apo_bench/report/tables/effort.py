"""What replays take, as a table."""

from __future__ import annotations

from collections.abc import Sequence

from apo_bench.report.page.markup import Table
from apo_bench.statistics.effort import Effort

WORDS = (
    "Of trials that were right: the operations that were undone and done again, the simulated time, and how far a part "
    "that was in place was pushed at most."
)


def effort_table(found: Sequence[Effort]) -> Table:
    """For people."""
    head = ("scenario", "method", "right", "extra operations", "simulated", "pushed at most")
    rows: list[tuple[object, ...]] = [
        (e.scenario, e.method, e.trials, f"{e.extra_operations:.1f}", f"{e.sim_seconds:.0f} s", f"{e.pushed_mm:.2f} mm")
        for e in found
    ]
    return Table(head, rows, words=2)
