"""Success over what is not the level: the number of looks, and tightness, which is clearance over level.

Every figure of a sweep that has something to show.
"""

from collections.abc import Callable, Mapping, Sequence

from apo_bench.records import knows_truth, may_look
from apo_bench.report.figures.bars import outcome_figure, prediction_figure, time_figure
from apo_bench.report.figures.levels import (
    SUCCESS_AXIS,
    difference_figure,
    gap_figure,
    methods_of,
    rate_words,
    recognition_figure,
    success_figure,
)
from apo_bench.report.figures.lines import Axis, MethodLine, Point, dodges, entries, levels_axis, line_panel
from apo_bench.report.figures.sheet import DrawnFigure, Figure, Panel, draw, styles
from apo_bench.statistics import (
    Cell,
    Confusion,
    GapSummary,
    Recognition,
    Setting,
    TrialTimes,
    level_label,
    level_of,
    level_words,
    members,
)
from apo_bench.statistics.levels.half_level import Summary
from apo_bench.statistics.settings import settings

_DODGE = 1.03
"""Methods stand this factor from each other at one tightness, so that equal rates do not hide each other."""


def looks_figure(cells: Sequence[Cell]) -> Figure:
    """What it is worth to look again, beside the methods that cannot ask for it: a panel per setting in which several
    numbers of looks were allowed; a line per method and level."""
    grouped = _together(cells, lambda setting: setting._replace(looks=0), lambda c: c.rate is not None)
    varied = {s: own for s, own in grouped.items() if len({c.looks for c in own if may_look(c.method)}) > 1}
    return Figure(
        "Success over the number of looks",
        [_looks_panel(setting, own) for setting, own in varied.items()],
        entries(styles(methods_of(cells))),
    )


def tightness_figure(cells: Sequence[Cell]) -> Figure:
    """How much room a part has for what the camera errs: panels as over the level, but of all clearances together, if
    a scenario has several; a line per method and level."""
    swept = {(c.scenario, c.clearance_mm) for c in cells}
    if len(swept) == len({scenario for scenario, _ in swept}):
        return Figure("Success over tightness", ())
    grouped = _together(
        cells, lambda setting: setting._replace(clearance_mm=0.0), lambda c: bool(c.tightness) and c.rate is not None
    )
    return Figure(
        "Success over tightness",
        [_tightness_panel(setting, own) for setting, own in grouped.items()],
        entries(styles(methods_of(cells))),
    )


def _together(
    cells: Sequence[Cell], merged: Callable[[Setting], Setting], has_place: Callable[[Cell], bool]
) -> dict[Setting, list[Cell]]:
    """The cells of settings that are put together, each once, without the oracle and those without a place."""
    grouped: dict[Setting, dict[tuple[object, ...], Cell]] = {}
    for setting, own in members(settings(cells), cells).items():
        inside = grouped.setdefault(merged(setting), {})
        inside |= {
            (c.method, level_of(c), c.looks, c.clearance_mm): c
            for c in own
            if not knows_truth(c.method) and has_place(c)
        }
    return {setting: list(own.values()) for setting, own in grouped.items() if own}


def _looks_panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    looks = sorted({c.looks for c in cells})
    aside = dodges(len({c.method for c in cells}))

    lines = _lines(
        cells,
        lambda c, i: looks.index(c.looks) + aside[i],
        lambda c: f"{level_words(level_of(c), c.noise)}, looks {c.looks}",
    )
    x = levels_axis([str(n) for n in looks], "looks allowed after the first")
    return line_panel(setting.title(), x, SUCCESS_AXIS, lines)


def _tightness_panel(setting: Setting, cells: Sequence[Cell]) -> Panel:
    middle = (len({c.method for c in cells}) - 1) / 2

    lines = _lines(
        cells,
        lambda c, i: (c.tightness or 0.0) * _DODGE ** (i - middle),
        lambda c: f"{level_label(c.level, c.level_deg, c.noise)}, clearance {c.clearance_mm:g} mm",
    )
    tried = sorted({c.tightness for c in cells if c.tightness})
    ticks = [(t, f"{t:g}") for t in tried]
    x = Axis("clearance per side over level [mm per mm]", tried[0] / 1.3, tried[-1] * 1.3, ticks, logarithmic=True)
    return line_panel(", ".join([setting.scenario, *setting.conditions(clearance=False)]), x, SUCCESS_AXIS, lines)


def _lines(cells: Sequence[Cell], at: Callable[[Cell, int], float], words: Callable[[Cell], str]) -> list[MethodLine]:
    """A line per method and level; `at` is where on the axis a cell of the i-th method stands."""
    lines = []
    for i, (method, style) in enumerate(styles(list(dict.fromkeys(c.method for c in cells))).items()):
        for level in sorted({level_of(c) for c in cells if c.method == method}):
            points = [
                Point(
                    at(c, i),
                    c.rate or 0.0,
                    *c.interval,
                    f"level {words(c)}: {rate_words(c)}",
                )
                for c in sorted(cells, key=lambda c: (c.looks, c.clearance_mm))
                if c.method == method and level_of(c) == level
            ]
            lines.append(MethodLine(method, style, points))
    return lines


def figures(
    numbers: Summary,
    grouped: Mapping[Setting, Sequence[Cell]],
    gaps: Sequence[GapSummary],
    confusions: Sequence[Confusion],
    recognitions: Sequence[Recognition],
    times: Sequence[TrialTimes],
) -> dict[str, DrawnFigure]:
    """By the name of their file."""
    where = list(grouped)
    looks = styles(methods_of(numbers.cells))
    pairs = members(where, numbers.pairs)
    figures = {
        "success_over_level": success_figure(numbers.cells),
        "success_over_tightness": tightness_figure(numbers.cells),
        "success_over_looks": looks_figure(numbers.cells),
        "failure_stages": outcome_figure(grouped),
        "gap_before_and_after": gap_figure(members(where, gaps), looks),
        "prediction": prediction_figure(confusions),
        "recognised": recognition_figure(recognitions),
        "timing": time_figure(times),
    }
    for reference in dict.fromkeys(p.reference for p in numbers.pairs):
        figures[f"difference_to_{reference}"] = difference_figure(pairs, reference, looks)
    return {name: draw(figure) for name, figure in figures.items() if figure.panels}
