"""Success over tightness, clearance over level: how much room a part has for what the camera errs."""

from collections.abc import Sequence

from apo_bench.records.method import knows_truth
from apo_bench.report.figures.levels import SHARES, methods_of
from apo_bench.report.figures.lines import Axis, MethodLine, Point, entries, line_panel
from apo_bench.report.figures.sheet import Figure, Panel
from apo_bench.report.figures.styles import styles
from apo_bench.statistics.rate_text import interval, level_label, percent
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import Setting, members, settings

_DODGE = 1.03
"""Methods stand this factor from each other at one tightness, so that equal rates do not hide each other."""


def varies(cells: Sequence[Cell]) -> bool:
    """Whether there is more than one clearance for a scenario, and a level above zero."""
    swept = {(c.scenario, c.clearance_mm) for c in cells}
    return len(swept) > len({scenario for scenario, _ in swept}) and any(c.tightness for c in cells)


def tightness_figure(cells: Sequence[Cell]) -> Figure:
    """Panels as over the level, but of all clearances together; a line per method and level."""
    if not varies(cells):
        return Figure("Success over tightness", ())
    grouped: dict[Setting, dict[tuple[object, ...], Cell]] = {}
    for setting, own in members(settings(cells), cells).items():
        inside = grouped.setdefault(setting._replace(clearance_mm=0.0), {})
        for c in own:
            if not knows_truth(c.method) and c.tightness and c.rate is not None:
                inside[c.method, c.level, c.level_deg, c.clearance_mm] = c
    panels = [_panel(setting, list(own.values())) for setting, own in grouped.items() if own]
    return Figure("Success over tightness", panels, entries(styles(methods_of(cells))))


def _panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    looks = styles(list(dict.fromkeys(c.method for c in cells)))
    lines = []
    for i, (method, style) in enumerate(looks.items()):
        dodge = _DODGE ** (i - (len(looks) - 1) / 2)
        for level in sorted({(c.level, c.level_deg) for c in cells if c.method == method}):
            own = [c for c in cells if c.method == method and (c.level, c.level_deg) == level]
            points = [
                Point(
                    (c.tightness or 0.0) * dodge,
                    c.rate or 0.0,
                    *c.interval,
                    f"level {level_label(*level, c.noise)}, clearance {c.clearance_mm:g} mm: {percent(c.rate)} "
                    f"({interval(c)}), n {c.trials}",
                )
                for c in sorted(own, key=lambda c: c.clearance_mm)
            ]
            lines.append(MethodLine(method, style, points))
    found = sorted({c.tightness for c in cells if c.tightness})
    ticks = [(t, f"{t:g}") for t in found]
    x = Axis("clearance per side over level [mm per mm]", found[0] / 1.3, found[-1] * 1.3, ticks, logarithmic=True)
    title = ", ".join([setting.scenario, *setting.conditions(clearance=False)])
    return line_panel(title, x, Axis("success", 0.0, 1.0, SHARES), lines)
