"""Whether a schedule of do and undo steps makes sense."""

from __future__ import annotations

from collections.abc import Sequence

from apo_bench.program import Step

REMEDY = "do every operation, undo only what is done, and have everything done at the end"


def fault(schedule: Sequence[Step], operations: int) -> str:
    """What is wrong with it, such as `undoes operation 2, which is not done`; empty if nothing is."""
    done = set[int]()
    for k, undo in schedule:
        if not 0 <= k < operations:
            return f"names operation {k + 1}, where {operations} are known"
        if undo and k not in done:
            return f"undoes operation {k + 1}, which is not done"
        if not undo and k in done:
            return f"does operation {k + 1} again, which is done"
        done ^= {k}
    missing = sorted(set(range(operations)) - done)
    return f"leaves operation {missing[0] + 1} undone" if missing else ""
