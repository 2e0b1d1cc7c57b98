"""Success rates of trials by condition, for scripts that write a page of results."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from apo_bench.benchmark.analysis import Rate, compute_wilson_interval
from apo_bench.records import TrialRecord
from apo_bench.records.run.run_folder import read_records

Key = TypeVar("Key")


def read_judged(folders: Iterable[Path]) -> list[TrialRecord]:
    """Return the trials of sweeps that have a verdict."""
    return [row for folder in folders for row in read_records(folder) if row["success"] is not None]


def group(rows: Iterable[TrialRecord], key: Callable[[TrialRecord], Key]) -> dict[Key, list[TrialRecord]]:
    """Return the trials of each key."""
    found: dict[Key, list[TrialRecord]] = defaultdict(list)
    for row in rows:
        found[key(row)].append(row)
    return found


def rate_of(rows: Sequence[TrialRecord]) -> Rate:
    """Count successes."""
    return Rate(sum(bool(row["success"]) for row in rows), len(rows))


def counted(rate: Rate | None) -> str:
    """Return `19 of 20 (76 to 99 %)`, with Wilson's 95 % interval; nothing where no trial ran."""
    if rate is None or not rate.trials:
        return ""
    return f"{rate.successes} of {rate.trials} ({100 * rate.interval.low:.0f} to {100 * rate.interval.high:.0f} %)"


def fraction(rate: Rate | None) -> str:
    """Return `19/20`; nothing where no trial ran."""
    return f"{rate.successes}/{rate.trials}" if rate is not None and rate.trials else ""


def widths(*trials: int) -> str:
    """Return how wide Wilson's 95 % intervals are at so many trials, in a sentence."""
    at = (f"{n} of {n} is {100 * compute_wilson_interval(n, n).low:.0f} to 100 %" for n in trials)
    return f"Wilson's 95 % intervals: {', '.join(at)}."


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    return [*lines, *(f"| {' | '.join(map(str, row))} |" for row in rows)]
