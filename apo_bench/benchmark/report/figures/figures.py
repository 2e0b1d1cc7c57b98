"""Every figure of a sweep that has something to show, by the name of its file."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from apo_bench.benchmark.analysis import (
    ALL,
    Cell,
    Line,
    Paired,
    Place,
    level_unit,
    levels_of,
    members,
    noise_label,
    noise_words,
)
from apo_bench.benchmark.report.figures.bars import Shares, bar_figure
from apo_bench.benchmark.report.figures.lines import Axes, Mark, line_figure
from apo_bench.benchmark.report.figures.sheet import Figure
from apo_bench.records import knows_truth, may_reobserve

_FLOOR_MM = 1e-3
"""Gaps below this are drawn here: what solvers leave of zero says nothing."""


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
    level = _unit(settings)
    tightness = Axes("clearance per side over level [mm per mm]", "success", "percent")
    max_reobservations = Axes("looks allowed after the first", "success", "percent")
    gap = ("Gap of the contacts as seen and as planned", _gaps(settings, gaps), Axes(level, "gap [mm]", "log"))
    lines = {
        "success_over_noise_level": ("Success over level", _over_level(by_setting), Axes(level, "success", "percent")),
        "success_over_tightness": ("Success over tightness", _over_tightness(cells), tightness),
        "success_over_looks": ("Success over the number of looks", _over_looks(cells), max_reobservations),
        "gap_before_and_after": gap,
        "detected": ("Recognised contacts", _recognised(recognitions), Axes("noise_level", "share", "percent")),
        "timing": ("Wall time of a trial", _times(times), Axes("method", "wall time [s]")),
    }
    for reference in dict.fromkeys(p.reference for p in pairs):
        marks = _differences(settings, [p for p in pairs if p.reference == reference and p.pairs])
        title = f"Difference of success to {reference}, same seeds"
        lines[f"difference_to_{reference}"] = (title, marks, Axes(level, "difference [points]", "points"))
    bars = {
        "failure_stages": ("Where trials failed", _stages(by_setting)),
        "prediction": ("Predicted against real failure", _predicted(confusions)),
    }
    drawn = {name: line_figure(title, marks, axes) for name, (title, marks, axes) in lines.items() if marks}
    return drawn | {name: bar_figure(title, panels) for name, (title, panels) in bars.items() if panels}


def _over_level(by_setting: Mapping[Place, Sequence[Cell]]) -> list[Mark]:
    """A panel per setting that has two levels or more; if there is none, of every setting.

    The oracle meets no level, so it stands at each.
    """
    levels = {s: levels_of(own) for s, own in by_setting.items()}
    least = min(2, max(map(len, levels.values()), default=1))
    return [
        Mark(_title(s, own), c.method, level, noise_words(level, s.noise), c.rate, *c.interval)
        for s, own in by_setting.items()
        for c in own
        if len(levels[s]) >= max(1, least) and c.rate is not None
        for level in (levels[s] if knows_truth(c.method) else [(c.noise_mm, c.noise_deg)])
    ]


def _title(setting: Place, cells: Sequence[Cell]) -> str:
    """With how many trials its cells have."""
    trials = [c.trials for c in cells]
    return f"{setting.title}; n\u00a0{' to '.join(map(str, dict.fromkeys((min(trials), max(trials)))))}"


def _differences(settings: Sequence[Place], pairs: Sequence[Paired]) -> list[Mark]:
    """A panel per setting in which methods are compared with a reference."""
    here = members(settings, [p for p in pairs if p.place.method != "uncorrected"])
    return [_mark(s, p.place, p.difference or 0.0, *p.interval) for s, own in here.items() for p in own]


def _gaps(settings: Sequence[Place], lines: Sequence[Line]) -> list[Mark]:
    """Gaps as seen, which are the same for every method, and as planned."""
    placed = {line["place"]: line for line in lines}
    here = [(s, place) for s, places in members(settings, list(placed)).items() for place in places]
    seen = [_mark(s, place._replace(method="as seen"), *_percentiles(placed[place], "seen")) for s, place in here]
    once = {mark[:3]: mark for mark in seen}
    return [*once.values(), *(_mark(s, place, *_percentiles(placed[place], "planned")) for s, place in here)]


def _percentiles(line: Line, of: str) -> list[float]:
    return [max(line[f"{of}_{name}"], _FLOOR_MM) for name in ("median_mm", "5", "95")]


def _recognised(lines: Sequence[Line]) -> list[Mark]:
    """Over all scenarios where there are several."""
    return [
        Mark(
            f"{what}; {line['noise']}, carelessness {line['human_error_scale']:g}",
            line["contact_source"],
            (line["noise_mm"], line["noise_deg"]),
            noise_label(line["noise_mm"], line["noise_deg"], line["noise"]),
            *[line[what]] * 3,
        )
        for line in [line for line in lines if line["scenario"] == ALL] or lines
        for what in ("precision", "recall")
        if line[what] is not None
    ]


def _times(lines: Sequence[Line]) -> list[Mark]:
    names = ("trial_median_s", "trial_5_s", "trial_95_s")
    return [Mark(line["scenario"], *[line["method"]] * 3, *(line[name] for name in names)) for line in lines]


def _over_looks(cells: Sequence[Cell]) -> list[Mark]:
    """What it is worth to look again, beside the methods that cannot ask for it, where several numbers were allowed."""
    several = len({c.max_reobservations for c in cells if may_reobserve(c.method)}) > 1
    return [
        Mark(
            c.setting._replace(max_reobservations=0).title,
            f"{c.method}, {c.noise_words}",
            c.max_reobservations,
            f"{c.max_reobservations}",
            c.rate,
            *c.interval,
        )
        for c in cells
        if several and c.rate is not None and not knows_truth(c.method)
    ]


def _over_tightness(cells: Sequence[Cell]) -> list[Mark]:
    """How much room a part has for what the camera errs: all clearances together, if a scenario has several."""
    several = len({(c.scenario, c.clearance_mm) for c in cells}) > len({c.scenario for c in cells})
    return [
        Mark(c.setting._replace(clearance_mm=0.0).title, c.method, c.tightness, f"{c.tightness:g}", c.rate, *c.interval)
        for c in cells
        if several and c.tightness and c.rate is not None and not knows_truth(c.method)
    ]


def _stages(by_setting: Mapping[Place, Sequence[Cell]]) -> dict[str, Shares]:
    """For every cell of a setting a bar of shares: success, then the stages that failed."""
    bars = {
        s.title: {f"{c.method}, {c.noise_words}": _endings(c) for c in own if c.trials} for s, own in by_setting.items()
    }
    return {title: own for title, own in bars.items() if own}


def _endings(cell: Cell) -> dict[str, int]:
    counts = {"success": cell.successes} if cell.successes else {}
    for why, count in cell.failures.items():
        stage = why.partition(":")[0]
        counts[stage] = counts.get(stage, 0) + count
    return counts


def _predicted(lines: Sequence[Line]) -> dict[str, Shares]:
    """For every method a bar of what was predicted and came of it."""
    kinds = ("fit_fitted", "fit_failed", "fail_fitted", "fail_failed")
    bars = {
        f"{line['scenario']}, {line['method']}": {kind.replace("_", ": "): line[f"predicted_{kind}"] for kind in kinds}
        for line in lines
        if line["executed"]
    }
    return {"predicted: what happened": bars} if bars else {}


def _mark(setting: Place, place: Place, value: float, low: float, high: float) -> Mark:
    """Of something at a level."""
    level = (place.noise_mm, place.noise_deg)
    return Mark(setting.title, place.method, level, noise_words(level, setting.noise), value, low, high)


def _unit(settings: Iterable[Any]) -> str:
    """What a level is; where settings differ in that, each of them."""
    return "; ".join(dict.fromkeys(level_unit(setting.noise) for setting in settings))
