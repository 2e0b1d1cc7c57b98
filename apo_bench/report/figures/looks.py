"""Success over the number of looks: what it is worth to look again, beside the methods that cannot ask for it."""

from collections.abc import Iterable, Sequence

from apo_bench.records.method import knows_truth, may_look
from apo_bench.report.figures.levels import SHARES, methods_of
from apo_bench.report.figures.lines import Axis, MethodLine, Point, dodges, entries, levels_axis, line_panel
from apo_bench.report.figures.sheet import Figure, Panel
from apo_bench.report.figures.styles import styles
from apo_bench.statistics.rate_text import interval, percent
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, level_of, level_words, members, settings


def looks_figure(cells: Sequence[Cell]) -> Figure:
    """A panel per setting in which several numbers of looks were allowed; a line per method and level."""
    grouped: dict[Setting, dict[tuple[object, ...], Cell]] = {}
    for setting, own in members(settings(cells), cells).items():
        inside = grouped.setdefault(setting._replace(looks=0), {})
        inside |= {(c.method, level_of(c), c.looks): c for c in own if not knows_truth(c.method) and c.rate is not None}
    varied = {s: list(own.values()) for s, own in grouped.items() if len(_looks(own.values())) > 1}
    panels = [_panel(setting, own) for setting, own in varied.items()]
    return Figure("Success over the number of looks", panels, entries(styles(methods_of(cells))))


def _looks(cells: Iterable[Cell]) -> list[int]:
    return sorted({c.looks for c in cells if may_look(c.method)})


def _panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    looks = sorted({c.looks for c in cells})
    lines = []
    methods = styles(list(dict.fromkeys(c.method for c in cells)))
    for (method, style), dodge in zip(methods.items(), dodges(len(methods)), strict=True):
        for level in sorted({level_of(c) for c in cells if c.method == method}):
            own = [c for c in cells if c.method == method and level_of(c) == level]
            points = [
                Point(
                    looks.index(c.looks) + dodge,
                    c.rate or 0.0,
                    *c.interval,
                    f"level {level_words(level, c.noise)}, looks {c.looks}: {percent(c.rate)} ({interval(c)}), "
                    f"n {c.trials}",
                )
                for c in sorted(own, key=lambda c: c.looks)
            ]
            lines.append(MethodLine(method, style, points))
    x = levels_axis([str(n) for n in looks], "looks allowed after the first")
    return line_panel(setting.title(), x, Axis("success", 0.0, 1.0, SHARES), lines)
