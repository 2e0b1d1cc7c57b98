"""Figures over the noise level: success, paired differences, gaps, and contacts that were recognised."""

import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from typing import Any, TypeVar

from apo_bench.io import grouped
from apo_bench.records import RANGE, knows_truth
from apo_bench.report.figures.lines import Axis, MethodLine, Point, RuleLine, dodges, entries, levels_axis, line_panel
from apo_bench.report.figures.sheet import RECOGNITION_STYLES, SEEN, Figure, Panel, Style, styles
from apo_bench.statistics import (
    ALL,
    Cell,
    GapSummary,
    Paired,
    Quantiles,
    Recognition,
    Setting,
    cell_place,
    level_of,
    level_unit,
    level_words,
    levels_of,
    members,
    percent,
    percents,
)
from apo_bench.statistics.settings import settings

_Item = TypeVar("_Item")
SUCCESS_AXIS = Axis("success", 0.0, 1.0, tuple((x / 100, f"{x} %") for x in (0, 25, 50, 75, 100)))
_STEPS = (1, 2, 5, 10, 20, 25, 50, 100)
_FLOOR_MM = 1e-3
"""Gaps below this are drawn here: what solvers leave of zero says nothing."""
_RECOGNITION = {"precision": "precision", "recall": "recall", "demonstrations all right": "all_right.rate"}


def success_figure(cells: Sequence[Cell]) -> Figure:
    """Success over level: a panel per setting that has two levels or more; if there is none, of every setting."""
    looks = styles(methods_of(cells))
    grouped = {s: own for s, own in members(settings(cells), cells).items() if levels_of(own)}
    varied = {s: own for s, own in grouped.items() if len(levels_of(own)) > 1}
    return Figure(
        "Success over level",
        [_success(setting, own, looks) for setting, own in (varied or grouped).items()],
        entries(looks, any(cell.method == "oracle" for cell in cells)),
    )


def difference_figure(pairs: Mapping[Setting, Sequence[Paired]], reference: str, looks: Mapping[str, Style]) -> Figure:
    """Differences to a reference: a panel per setting in which methods are compared with it."""
    compared = {m: look for m, look in looks.items() if m not in (reference, "none")}
    here = {s: [p for p in own if p.reference == reference and p.pairs] for s, own in pairs.items()}
    return Figure(
        f"Difference of success to {reference}, same seeds",
        [_differences(setting, own, compared) for setting, own in here.items() if own],
        entries(compared),
    )


def gap_figure(gaps: Mapping[Setting, Sequence[GapSummary]], looks: Mapping[str, Style]) -> Figure:
    """Gaps as seen and as planned: a panel per setting in which a method corrected."""
    compared = {m: look for m, look in looks.items() if any(g.place.method == m for own in gaps.values() for g in own)}
    return Figure(
        "Gap of the contacts as seen and as planned",
        [_gaps(setting, own, compared) for setting, own in gaps.items() if own],
        entries({"as seen": SEEN, **compared}),
    )


def recognition_figure(recognitions: Sequence[Recognition]) -> Figure:
    """Precision, recall and demonstrations all right, over all scenarios where there are several."""
    drawn = [r for r in recognitions if r.place.scenario == ALL] or list(recognitions)
    rows = sorted({(r.place.noise, r.place.eye, r.place.careless) for r in drawn})
    panels = []
    for row in rows:
        here = [r for r in drawn if (r.place.noise, r.place.eye, r.place.careless) == row]
        where = f"{'range finder' if row[1] == RANGE else row[0]}, carelessness {row[2]:g}"
        panels += [_recognised(f"{name}; {where}", here, attrgetter(what)) for name, what in _RECOGNITION.items()]
    met = {r.place.relations for r in recognitions}
    kinds = {kind: style for kind, style in RECOGNITION_STYLES.items() if kind in met}
    return Figure("Recognised contacts over level", panels, entries(kinds))


def methods_of(cells: Sequence[Cell]) -> list[str]:
    """The methods that have a colour, in the order in which a reader looks for them."""
    return [m for m in dict.fromkeys(c.method for c in cells) if not knows_truth(m)]


def rate_words(c: Cell) -> str:
    """`97.0 % (91.5 to 99.0 %), n 100`."""
    return f"{percent(c.rate)} ({percents(c.interval)}), n {c.trials}"


def counted(numbers: Sequence[int], what: str = "") -> str:
    """`n 40`, or `n 38 to 160` where it differs, and of what."""
    ends = dict.fromkeys((min(numbers, default=0), max(numbers, default=0)))
    return f"n\u00a0{' to '.join(map(str, ends))}{f' {what}' if what else ''}"


def scale(values: Sequence[float]) -> Axis:
    """An axis in points that holds zero and all values (shares)."""
    low = 100 * min(0.0, *values)
    high = 100 * max(0.0, *values)
    step = next((s for s in _STEPS if (high - low) / s <= 6), _STEPS[-1])
    first = math.floor(low / step)
    last = max(math.ceil(high / step), math.floor(low / step) + 1)
    ticks = [(k * step / 100, f"{k * step:+d}" if k else "0") for k in range(first, last + 1)]
    return Axis("difference [points]", first * step / 100, last * step / 100, ticks)


def _success(setting: Setting, cells: Sequence[Cell], looks: Mapping[str, Style]) -> Panel:
    known = [c for c in cells if c.rate is not None]
    lines = _lines(setting, known, looks, lambda c: (c.rate or 0.0, *c.interval), rate_words)
    best = next((c for c in known if c.method == "oracle"), None)
    rule = None if best is None else RuleLine(best.rate or 0.0, True, f"oracle: {percent(best.rate)}, n {best.trials}")
    title = f"{setting.title()}; {counted([c.trials for c in cells])}"
    return line_panel(title, _levels(setting, cells), SUCCESS_AXIS, lines, rule)


def _differences(setting: Setting, pairs: Sequence[Paired], looks: Mapping[str, Style]) -> Panel:
    def tip(p: Paired) -> str:
        words = "{:+.1f} points ({:+.1f} to {:+.1f})".format(*(100 * x for x in (p.difference or 0.0, *p.interval)))
        return f"{words}, n {p.pairs} pairs"

    lines = _lines(setting, pairs, looks, lambda p: (p.difference or 0.0, *p.interval), tip)
    y = scale([x for p in pairs for x in p.interval])
    title = f"{setting.title()}; {counted([p.pairs for p in pairs], 'pairs')}"
    return line_panel(title, _levels(setting, pairs), y, lines, RuleLine(0.0))


def _gaps(setting: Setting, summaries: Sequence[GapSummary], looks: Mapping[str, Style]) -> Panel:
    def point(q: Quantiles) -> tuple[float, float, float]:
        return max(q.median, _FLOOR_MM), max(q.low, _FLOOR_MM), max(q.high, _FLOOR_MM)

    words = "as planned: median {0.planned.median:.3f} mm, 95 % below {0.planned.high:.3f} mm, n {0.trials}"
    planned = _lines(setting, summaries, looks, lambda g: point(g.planned), words.format)
    most_tried = [max((g for g in summaries if level_of(g) == x), key=lambda g: g.trials) for x in levels_of(summaries)]
    seen = [
        Point(float(i), *point(g.seen), f"median {g.seen.median:.3f} mm, n {g.trials}")
        for i, g in enumerate(most_tried)  # methods were shown the same
    ]
    values = [x for g in summaries for q in (g.seen, g.planned) for x in point(q)]
    low = math.floor(math.log10(min(values)))
    high = max(math.ceil(math.log10(max(values))), low + 1)
    ticks = [(10.0**k, _power(k)) for k in range(low, high + 1, max(1, (high - low) // 4))]
    y = Axis("gap [mm]", 10.0**low, 10.0**high, ticks, logarithmic=True)
    title = f"{setting.title()}; {counted([g.trials for g in summaries])}"
    return line_panel(title, _levels(setting, summaries), y, [MethodLine("as seen", SEEN, seen), *planned])


def _recognised(title: str, here: Sequence[Recognition], share: Callable[[Recognition], Any]) -> Panel:
    levels = sorted({level_of(r) for r in here})
    noise = RANGE if all(r.place.eye == RANGE for r in here) else ""
    kinds = [kind for kind in RECOGNITION_STYLES if any(r.place.relations == kind for r in here)]
    lines = []
    for kind, dodge in zip(kinds, dodges(len(kinds)), strict=True):
        points = [
            Point(levels.index(level_of(r)) + dodge, value, value, value, percent(value))
            for r in sorted(here, key=lambda r: r.place.level)
            if r.place.relations == kind and (value := share(r)) is not None
        ]
        lines.append(MethodLine(kind, RECOGNITION_STYLES[kind], points))
    least = min((p.value for line in lines for p in line.points), default=0.0)
    low = 0.0 if least < 0.6 else 0.6 if least < 0.9 else 0.9
    ticks = [(low + (1 - low) * k / 4, f"{100 * (low + (1 - low) * k / 4):g} %") for k in range(5)]
    x = levels_axis([level_words(level, noise) for level in levels], level_unit(noise))
    return line_panel(title, x, Axis("share", low, 1.0, ticks), lines)


def _levels(setting: Setting, items: Sequence[object]) -> Axis:
    return levels_axis([level_words(x, setting.noise) for x in levels_of(items)], level_unit(setting.noise))


def _lines(
    setting: Setting,
    items: Sequence[_Item],
    looks: Mapping[str, Style],
    point: Callable[[_Item], tuple[float, float, float]],
    tip: Callable[[_Item], str],
) -> list[MethodLine]:
    """A line per method, by a value with its interval and a sentence of each item."""
    levels = levels_of(items)
    by_method = grouped((cell_place(item).method, item) for item in items)
    drawn = {m: by_method[m] for m in looks if m in by_method}

    def words(item: _Item) -> str:
        return f"level {level_words(level_of(item), setting.noise)}: {tip(item)}"

    lines = []
    for (method, own), dodge in zip(drawn.items(), dodges(len(drawn)), strict=True):
        points = [Point(levels.index(level_of(item)) + dodge, *point(item), tip=words(item)) for item in own]
        lines.append(MethodLine(method, looks[method], points))
    return lines


def _power(k: int) -> str:
    """`0.01`, or `10⁻⁴`."""
    raised = str(k).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{10.0**k:g}" if -3 <= k <= 3 else f"10{raised}"
