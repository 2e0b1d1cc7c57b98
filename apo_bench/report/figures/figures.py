"""Every figure of a sweep that has something to show, by the name of its file."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from apo_bench.records import knows_truth, may_look
from apo_bench.report.figures.bars import bar_figure
from apo_bench.report.figures.lines import Axes, Mark, line_figure
from apo_bench.report.figures.sheet import Figure
from apo_bench.statistics import (
    ALL,
    Cell,
    Line,
    Paired,
    Place,
    level_label,
    level_unit,
    level_words,
    levels_of,
    members,
)

_FLOOR_MM = 1e-3
"""Gaps below this are drawn here: what solvers leave of zero says nothing."""
_LEVEL = "level"


def figures(
    cells: Sequence[Cell],
    pairs: Sequence[Paired],
    settings: Sequence[Place],
    gaps: Sequence[Line],
    confusions: Sequence[Line],
    recognitions: Sequence[Line],
    times: Sequence[Line],
) -> dict[str, Figure]:
    """All but those without a panel."""
    by_setting = members(settings, cells)
    drawn: dict[str, Callable[[], Figure] | None] = {
        "success_over_level": _success_over_level(by_setting),
        "success_over_tightness": _over_tightness(cells),
        "success_over_looks": _over_looks(cells),
        "failure_stages": _stages(by_setting),
        "gap_before_and_after": _gaps(settings, gaps),
        "prediction": _prediction(confusions),
        "recognised": _recognised(recognitions),
        "timing": _times(times),
    }
    for reference in dict.fromkeys(p.reference for p in pairs):
        drawn[f"difference_to_{reference}"] = _differences(settings, pairs, reference)
    return {name: make() for name, make in drawn.items() if make is not None}


def _lines(title: str, marks: Sequence[Mark], axes: Axes) -> Callable[[], Figure] | None:
    return partial(line_figure, title, marks, axes) if marks else None


def _success_over_level(by_setting: Mapping[Place, Sequence[Cell]]) -> Callable[[], Figure] | None:
    """A panel per setting that has two levels or more; if there is none, of every setting."""
    varied = {s: own for s, own in by_setting.items() if len(levels_of(own)) > 1}
    shown = varied or {s: own for s, own in by_setting.items() if levels_of(own)}
    marks = [mark for s, own in shown.items() for c in own for mark in _over_level(s, c, own)]
    return _lines("Success over level", marks, Axes(_unit(shown), "success", "percent"))


def _over_level(setting: Place, cell: Cell, others: Sequence[Cell]) -> list[Mark]:
    """One mark of a cell; of the oracle, which meets no level, one at each."""
    if cell.rate is None:
        return []
    met = levels_of(others) if knows_truth(cell.method) else [(cell.level, cell.level_deg)]
    title = f"{setting.title}; n\u00a0{_span(c.trials for c in others)}"
    return [
        Mark(title, cell.method, level, level_words(level, setting.noise), cell.rate, *cell.interval) for level in met
    ]


def _differences(settings: Sequence[Place], pairs: Sequence[Paired], reference: str) -> Callable[[], Figure] | None:
    """A panel per setting in which methods are compared with a reference."""
    here = members(settings, [p for p in pairs if p.reference == reference and p.pairs and p.place.method != "none"])
    marks = [_mark(s, p.place, p.difference or 0.0, *p.interval) for s, own in here.items() for p in own]
    axes = Axes(_unit(here), "difference [points]", "points")
    return _lines(f"Difference of success to {reference}, same seeds", marks, axes)


def _gaps(settings: Sequence[Place], lines: Sequence[Line]) -> Callable[[], Figure] | None:
    """Gaps as seen, which are the same for every method, and as planned."""
    placed = {line["place"]: line for line in lines}
    marks = [
        mark
        for setting, places in members(settings, list(placed)).items()
        for place in places
        for mark in (
            _mark(setting, place._replace(method="as seen"), *_quantiles(placed[place], "seen")),
            _mark(setting, place, *_quantiles(placed[place], "planned")),
        )
    ]
    once = list({mark[:3]: mark for mark in marks}.values())
    return _lines("Gap of the contacts as seen and as planned", once, Axes(_unit(placed), "gap [mm]", "log"))


def _recognised(lines: Sequence[Line]) -> Callable[[], Figure] | None:
    """Over all scenarios where there are several."""
    shown = [line for line in lines if line["scenario"] == ALL] or lines
    marks = [
        Mark(
            f"{what}; {line['noise']}, carelessness {line['careless']:g}",
            line["relations"],
            (line["level"], line["level_deg"]),
            level_label(line["level"], line["level_deg"], line["noise"]),
            value,
            *(value, value),
        )
        for line in shown
        for what in ("precision", "recall")
        if (value := line[what]) is not None
    ]
    return _lines("Recognised contacts over level", marks, Axes("level", "share", "percent"))


def _times(lines: Sequence[Line]) -> Callable[[], Figure] | None:
    marks = [
        Mark(
            f"{line['scenario']}; n\u00a0{line['trials']}",
            line["method"],
            line["method"],
            line["method"],
            *(line[f"trial_{name}_s"] for name in ("median", "5", "95")),
        )
        for line in lines
    ]
    return _lines("Wall time of a trial", marks, Axes("method", "wall time [s]"))


def _over_looks(cells: Sequence[Cell]) -> Callable[[], Figure] | None:
    """What it is worth to look again, beside the methods that cannot ask for it, where several numbers were allowed."""
    asked = {c.looks for c in cells if may_look(c.method)}
    marks = [
        Mark(
            c.setting._replace(looks=0).title,
            f"{c.method}, {c.level_words}",
            c.looks,
            str(c.looks),
            c.rate,
            *c.interval,
        )
        for c in cells
        if c.rate is not None and not knows_truth(c.method)
    ]
    axes = Axes("looks allowed after the first", "success", "percent")
    return _lines("Success over the number of looks", marks * (len(asked) > 1), axes)


def _over_tightness(cells: Sequence[Cell]) -> Callable[[], Figure] | None:
    """How much room a part has for what the camera errs: all clearances together, if a scenario has several."""
    swept = {(c.scenario, c.clearance_mm) for c in cells}
    several = len(swept) > len({scenario for scenario, _ in swept})
    marks = [
        Mark(c.setting._replace(clearance_mm=0.0).title, c.method, c.tightness, f"{c.tightness:g}", c.rate, *c.interval)
        for c in cells
        if c.tightness and c.rate is not None and not knows_truth(c.method)
    ]
    axes = Axes("clearance per side over level [mm per mm]", "success", "percent")
    return _lines("Success over tightness", marks * several, axes)


def _stages(by_setting: Mapping[Place, Sequence[Cell]]) -> Callable[[], Figure] | None:
    """For every cell of a setting a bar of shares: success, then the stages that failed."""
    counted = {s.title: [c for c in own if c.trials] for s, own in by_setting.items()}
    panels = {
        title: {f"{c.method}, {c.level_words}": _endings(c) for c in own} for title, own in counted.items() if own
    }
    return partial(bar_figure, "Where trials failed", panels) if panels else None


def _endings(cell: Cell) -> dict[str, int]:
    counts = {"success": cell.successes}
    for why, count in cell.failures.items():
        stage = why.partition(":")[0]
        counts[stage] = counts.get(stage, 0) + count
    return {ending: count for ending, count in counts.items() if count}


def _prediction(lines: Sequence[Line]) -> Callable[[], Figure] | None:
    """For every method a bar of what was predicted and came of it."""
    kinds = ("fit_fitted", "fit_failed", "fail_fitted", "fail_failed")
    bars = {
        f"{line['scenario']}, {line['method']}": {kind.replace("_", ": "): line[f"predicted_{kind}"] for kind in kinds}
        for line in lines
        if line["executed"]
    }
    return partial(bar_figure, "Predicted against real failure", {"predicted: what happened": bars}) if bars else None


def _mark(setting: Place, place: Place, value: float, low: float, high: float) -> Mark:
    """Of something at a level."""
    level = (place.level, place.level_deg)
    return Mark(setting.title, place.method, level, level_words(level, setting.noise), value, low, high)


def _quantiles(line: Line, of: str) -> list[float]:
    return [max(line[f"{of}_{name}"], _FLOOR_MM) for name in ("median_mm", "5", "95")]


def _unit(settings: Iterable[Place]) -> str:
    """What a level is in most of them."""
    units = [level_unit(setting.noise) for setting in settings]
    return max(units, key=units.count, default="")


def _span(numbers: Iterable[Any]) -> str:
    """`40`, or `38 to 160` where it differs."""
    known = list(numbers)
    return " to ".join(map(str, dict.fromkeys((min(known), max(known)))))
