"""The gap of the contacts before and after correction: quantiles over the trials of a cell."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.io.csv_file import write_csv
from apo_bench.records.method import knows_relations
from apo_bench.report.figures.chart import HEIGHT, Axes, Entry, Panel, Point, panel
from apo_bench.report.figures.curves import counted
from apo_bench.report.figures.levels import Style
from apo_bench.report.page.markup import Html, Table, joined, tag
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Place, order, place_of
from apo_bench.statistics.settings import Setting, level_of, level_unit, level_words, levels_of, setting_of

FLOOR_MM = 1e-6
"""Gaps below this are drawn here: what solvers leave of zero says nothing."""
CUTS = (5.0, 50.0, 95.0)
COLUMNS = (
    *Place._fields[:5], "level_mm", *Place._fields[6:], "trials", "seen_5", "seen_median_mm", "seen_95",
    "planned_5", "planned_median_mm", "planned_95",
)  # fmt: skip
WORDS = (
    "The largest distance of any face from the one it should touch, as it was seen and as the method planned it: "
    "medians, and in the drawing bands from the 5th to the 95th percentile of the trials. What is below 0.000001 mm is "
    "drawn there. `none` plans what was seen."
)
_LINE = tag("line", x1=0, x2=26, y1=7, y2=7, class_="seen")
SEEN = [Entry(joined([_LINE, tag("circle", cx=13, cy=7, r=3.5, class_="seen")]), "as seen")]
"""Of the legend."""


class Quantiles(NamedTuple):
    """Of gaps, [mm]."""

    low: float
    median: float
    high: float


@final
@dataclass(frozen=True)
class Gap:
    """Of the trials of a cell that had a plan."""

    place: Place
    trials: int
    seen: Quantiles
    planned: Quantiles


def gaps(rows: Iterable[Mapping[str, Any]]) -> tuple[Gap, ...]:
    """One per cell of a method that corrects, sorted as `tally` sorts."""
    groups: dict[Place, list[tuple[float, float]]] = {}
    for row in rows:
        place = place_of(row)
        both = (row.get("gap_before_mm"), row.get("gap_after_mm"))
        if place is not None and knows_relations(place.method) and None not in both:
            groups.setdefault(place, []).append((float(both[0] or 0.0), float(both[1] or 0.0)))
    return tuple(_gap(place, groups[place]) for place in sorted(groups, key=order))


def gap_table(found: Sequence[Gap]) -> Table:
    """For people."""
    head = ("scenario", "conditions", "method", "level", "n", "as seen [mm]", "as planned [mm]", "95 % are below [mm]")
    rows: list[tuple[object, ...]] = []
    for g in found:
        p, level = g.place, level_label(*level_of(g), g.place.noise)
        numbers = (f"{g.seen.median:.3g}", f"{g.planned.median:.2g}", f"{g.planned.high:.2g}")
        rows.append((p.scenario, ", ".join(setting_of(p).conditions()), p.method, level, g.trials, *numbers))
    return Table(head, rows, words=3)


def write_gaps(found: Sequence[Gap], path: Path) -> None:
    """One line per cell."""
    write_csv(path, COLUMNS, ((*g.place, g.trials, *g.seen, *g.planned) for g in found))


def gap_panels(grouped: Mapping[Setting, Sequence[Gap]], looks: Mapping[str, tuple[int, Style]]) -> list[Panel]:
    """Of every setting in which a method corrected."""
    return [_panel(setting, found, looks) for setting, found in grouped.items() if found]


def _gap(place: Place, both: Sequence[tuple[float, float]]) -> Gap:
    import numpy as np

    seen, planned = (Quantiles(*map(float, q)) for q in np.percentile(np.array(both), CUTS, axis=0).T)
    return Gap(place, len(both), seen, planned)


def _panel(setting: Setting, found: Sequence[Gap], looks: Mapping[str, tuple[int, Style]]) -> Panel:
    levels = levels_of(found)
    most = max(_log(q.high) for g in found for q in (g.seen, g.planned))
    least = min(_log(q.low) for g in found for q in (g.seen, g.planned))
    low, high = math.floor(least), max(math.ceil(most), math.floor(least) + 1)
    step = max(1, (high - low) // 4)
    axes = Axes(
        levels=levels,
        labels=[level_words(level, setting.noise) for level in levels],
        below=level_unit(setting.noise),
        beside="gap [mm]",
        low=float(low),
        high=float(high),
        ticks=[(10.0**k, _power(k)) for k in range(low, high + 1, step)],
        place=_log,
    )
    lines = {m: [_point(g, g.planned, "as planned") for g in found if g.place.method == m] for m in looks}
    one = panel(f"{setting.title()}; {counted([g.trials for g in found])}", axes, lines, looks)
    return Panel(one.title, Html(_seen(axes, found) + one.drawing), HEIGHT)


def _seen(axes: Axes, found: Sequence[Gap]) -> str:
    """The gap as it was seen, of whichever method was tried most at a level: methods were shown the same."""
    best = {level: max((g for g in found if level_of(g) == level), key=lambda g: g.trials) for level in axes.levels}
    at = [(axes.x(level), g.seen) for level, g in best.items()]
    line = "L".join(f"{x:.1f} {axes.y(q.median):.1f}" for x, q in at)
    band = "L".join(
        [f"{x:.1f} {axes.y(q.high):.1f}" for x, q in at] + [f"{x:.1f} {axes.y(q.low):.1f}" for x, q in reversed(at)]
    )
    dots = "".join(
        f'<circle class="seen" cx="{x:.1f}" cy="{axes.y(q.median):.1f}" r="3.5"><title>as seen: {q.median:.3g} mm, '
        f"n {g.trials}</title></circle>"
        for (x, q), g in zip(at, best.values(), strict=True)
    )
    return f'<path class="seenband" d="M{band}Z"/><path class="seen" d="M{line}"/>{dots}'


def _point(g: Gap, q: Quantiles, what: str) -> Point:
    level = level_words(level_of(g), g.place.noise)
    tip = f"level {level}, {what}: median {q.median:.2g} mm, 95 % below {q.high:.2g} mm, n {g.trials}"
    return Point(level_of(g), q.median, q.low, q.high, tip)


def _power(k: int) -> str:
    """`0.01`, or `10⁻⁴`."""
    if -2 <= k <= 3:
        return f"{10.0**k:g}"
    return "10" + str(k).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _log(mm: float) -> float:
    return math.log10(max(mm, FLOOR_MM))
