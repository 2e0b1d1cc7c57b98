"""How rates are said."""

from __future__ import annotations

from apo_bench.records.settings import RANGE
from apo_bench.statistics.rates import Cell


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


def level_label(level: float, level_deg: float, noise: str = "") -> str:
    """`0.5`, `0.5 mm, 1 deg` where the two differ, or `0.5 mm per ray` of the range finder."""
    if noise == RANGE:
        return f"{level:g} mm per ray"
    return f"{level:g}" if level == level_deg else f"{level:g} mm, {level_deg:g} deg"
