"""Success over level, and paired differences over level: a panel per setting."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from apo_bench.report.figures.chart import Axes, Panel, Point, panel
from apo_bench.report.figures.levels import Style, styles
from apo_bench.statistics.paired import Paired
from apo_bench.statistics.rate_text import interval, percent
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, level_of, level_unit, level_words, levels_of

Looks = Mapping[str, tuple[int, Style]]
SHARES = tuple((x / 100, f"{x} %") for x in (0, 25, 50, 75, 100))
STEPS = (1, 2, 5, 10, 20, 25, 50, 100)


def looks_of(methods: Sequence[str]) -> dict[str, tuple[int, Style]]:
    """Number in the palette and style of every method but the oracle."""
    return {method: (i, style) for i, (method, style) in enumerate(styles(methods).items())}


def success_panels(grouped: Mapping[Setting, Sequence[Cell]], looks: Looks) -> list[Panel]:
    """Of every setting that has two levels or more."""
    return [_success(setting, cells, looks) for setting, cells in grouped.items() if len(levels_of(cells)) > 1]


def difference_panels(grouped: Mapping[Setting, Sequence[Paired]], reference: str, looks: Looks) -> list[Panel]:
    """Of every setting in which methods are compared with this reference."""
    made = []
    for setting, pairs in grouped.items():
        here = [p for p in pairs if p.reference == reference and p.difference is not None]
        if here:
            made.append(_differences(setting, here, looks))
    return made


def _success(setting: Setting, cells: Sequence[Cell], looks: Looks) -> Panel:
    levels = levels_of(cells)
    ceiling = next((c for c in cells if c.method == "oracle" and c.rate is not None), None)
    axes = Axes(
        levels=levels,
        labels=[level_words(level, setting.noise) for level in levels],
        below=level_unit(setting.noise),
        beside="success",
        low=0.0,
        high=1.0,
        ticks=SHARES,
        ceiling=None
        if ceiling is None
        else (ceiling.rate or 0.0, f"oracle: {percent(ceiling.rate)}, n {ceiling.trials}"),
    )
    lines = {m: [_point(c) for c in cells if c.method == m and c.rate is not None] for m in looks}
    return panel(f"{setting.title()}; {counted([c.trials for c in cells])}", axes, lines, looks)


def _point(c: Cell) -> Point:
    tip = f"level {level_words(level_of(c), c.noise)}: {percent(c.rate)} ({interval(c)}), n {c.trials}"
    return Point(level_of(c), c.rate or 0.0, *c.interval, tip)


def _differences(setting: Setting, pairs: Sequence[Paired], looks: Looks) -> Panel:
    levels = levels_of(pairs)
    low, high, ticks = scale([*(p.interval.low for p in pairs), *(p.interval.high for p in pairs)])
    axes = Axes(
        levels=levels,
        labels=[level_words(level, setting.noise) for level in levels],
        below=level_unit(setting.noise),
        beside="difference [points]",
        low=low,
        high=high,
        ticks=ticks,
        zero=0.0,
    )
    lines = {m: [_difference(p, setting.noise) for p in pairs if p.place.method == m] for m in looks}
    return panel(f"{setting.title()}; {counted([p.pairs for p in pairs], 'pairs')}", axes, lines, looks)


def _difference(p: Paired, noise: str) -> Point:
    low, high = p.interval
    d = p.difference or 0.0
    tip = (
        f"level {level_words(level_of(p), noise)}: {100 * d:+.1f} points "
        f"({100 * low:+.1f} to {100 * high:+.1f}), n {p.pairs} pairs"
    )
    return Point(level_of(p), d, low, high, tip)


def scale(values: Sequence[float]) -> tuple[float, float, list[tuple[float, str]]]:
    """Ends and ticks of an axis in points that holds zero and all values (shares)."""
    low, high = 100 * min(0.0, *values), 100 * max(0.0, *values)
    step = next((s for s in STEPS if (high - low) / s <= 6), STEPS[-1])
    first, last = math.floor(low / step), max(math.ceil(high / step), math.floor(low / step) + 1)
    ticks = [(k * step / 100, f"{k * step:+d}" if k else "0") for k in range(first, last + 1)]
    return first * step / 100, last * step / 100, ticks


def counted(numbers: Sequence[int], what: str = "") -> str:
    """`n 40`, or `n 38 to 160` where it differs, and of what."""
    low, high = min(numbers, default=0), max(numbers, default=0)
    return f"n\u00a0{low if low == high else f'{low} to {high}'}{f' {what}' if what else ''}"
