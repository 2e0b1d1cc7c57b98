"""How rates are said."""

from __future__ import annotations

from apo_bench.benchmark.statistics import Cell


def percent(rate: float | None) -> str:
    """`97.0 %`, or a dash where nothing counted."""
    return "–" if rate is None else f"{100 * rate:.1f} %"


def interval(cell: Cell) -> str:
    """`91.5 to 99.0 %`."""
    low, high = cell.interval
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def failures(cell: Cell, most: int = 3) -> str:
    """`attach: force_stop 12, judge: gap 3`: the most frequent endings of trials that failed."""
    return ", ".join(f"{why} {count}" for why, count in list(cell.failures.items())[:most])
