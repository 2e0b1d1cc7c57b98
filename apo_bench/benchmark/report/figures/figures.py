"""Draw every figure of a sweep that has data, by the name of its file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from apo_bench.benchmark.analysis import (
    ALL,
    Condition,
    ConditionResult,
    Line,
    PairedComparison,
    format_noise,
    format_noise_label,
    get_level_unit,
    group_by_setting,
    list_levels,
)
from apo_bench.benchmark.report.figures.bars import Shares, draw_bars
from apo_bench.benchmark.report.figures.lines import Axes, IntervalMark, draw_lines
from apo_bench.benchmark.report.figures.sheet import Figure
from apo_bench.records import knows_truth, may_reobserve

_FLOOR_MM = 1e-3
"""Smaller gaps are drawn at this value, since they are residuals of solvers."""


def draw_figures(
    results: Sequence[ConditionResult],
    pairs: Sequence[PairedComparison],
    settings: Sequence[Condition],
    gaps: Sequence[Line],
    confusions: Sequence[Line],
    detections: Sequence[Line],
    times: Sequence[Line],
) -> dict[str, Figure]:
    """Draw all figures that have data; returns name -> figure.

    Args:
        settings: The settings that get a panel each.
        gaps, confusions, detections, times: Lines of the tables of the same names.
    """
    by_setting = group_by_setting(settings, results)
    level = "; ".join(dict.fromkeys(get_level_unit(setting.noise) for setting in settings))
    tightness = Axes("clearance per side over noise level [mm per mm]", "success", "percent")
    lines = {
        "success_over_noise_level": (
            "Success over noise level",
            _draw_over_level(by_setting),
            Axes(level, "success", "percent"),
        ),
        "success_over_tightness": ("Success over tightness", _draw_over_tightness(results), tightness),
        "success_over_reobservations": (
            "Success over reobservations",
            _draw_over_reobservations(results),
            Axes("reobservations allowed", "success", "percent"),
        ),
        "gap_before_and_after": (
            "Gap of the contacts, observed and planned",
            _draw_gaps(settings, gaps),
            Axes(level, "gap [mm]", "log"),
        ),
        "detected": ("Detected contacts", _draw_detection(detections), Axes("noise level", "share", "percent")),
        "timing": ("Wall time of a trial", _draw_times(times), Axes("method", "wall time [s]")),
    }
    for reference in dict.fromkeys(p.reference for p in pairs):
        own = [p for p in pairs if p.reference == reference and p.pairs and p.condition.method != "uncorrected"]
        marks = [
            _make_mark(s, p.condition, p.difference or 0.0, *p.interval)
            for s, inside in group_by_setting(settings, own).items()
            for p in inside
        ]
        title = f"Difference of success to {reference}, same seeds"
        lines[f"difference_to_{reference}"] = (title, marks, Axes(level, "difference [points]", "points"))
    bars = {
        "failure_stages": ("Stages of failures", _draw_stages(by_setting)),
        "prediction": ("Predicted against real failure", _draw_predictions(confusions)),
    }
    drawn = {name: draw_lines(title, marks, axes) for name, (title, marks, axes) in lines.items() if marks}
    return drawn | {name: draw_bars(title, panels) for name, (title, panels) in bars.items() if panels}


def _draw_over_level(by_setting: Mapping[Condition, Sequence[ConditionResult]]) -> list[IntervalMark]:
    """Mark success for each setting with two noise levels or more; if there is none, for each setting.

    The oracle, which noise does not affect, is marked at every level.
    """
    levels = {s: list_levels(own) for s, own in by_setting.items()}
    least = min(2, max(map(len, levels.values()), default=1))
    return [
        IntervalMark(_format_title(s, own), c.method, level, format_noise(level, s.noise), c.rate, *c.interval)
        for s, own in by_setting.items()
        for c in own
        if len(levels[s]) >= max(1, least) and c.rate is not None
        for level in (levels[s] if knows_truth(c.method) else [(c.noise_mm, c.noise_deg)])
    ]


def _format_title(setting: Condition, results: Sequence[ConditionResult]) -> str:
    """Return the title of a setting with the range of its numbers of trials."""
    trials = [c.trials for c in results]
    return f"{setting.title}; n\u00a0{' to '.join(map(str, dict.fromkeys((min(trials), max(trials)))))}"


def _draw_gaps(settings: Sequence[Condition], lines: Sequence[Line]) -> list[IntervalMark]:
    """Mark the observed gaps, once for all methods, since these share them, and the planned gaps of each method."""
    of = {line["condition"]: line for line in lines}
    here = [(s, condition) for s, inside in group_by_setting(settings, list(of)).items() for condition in inside]
    observed = [_make_mark(s, replace(c, method="observed"), *_list_percentiles(of[c], "observed")) for s, c in here]
    once = {mark[:3]: mark for mark in observed}  # one mark per panel and level
    return [*once.values(), *(_make_mark(s, c, *_list_percentiles(of[c], "planned")) for s, c in here)]


def _list_percentiles(line: Line, of: str) -> list[float]:
    """Return median, 5th and 95th percentile of a kind of gap, at least `_FLOOR_MM`."""
    return [max(line[f"{of}_{name}"], _FLOOR_MM) for name in ("median_mm", "5", "95")]


def _draw_detection(lines: Sequence[Line]) -> list[IntervalMark]:
    """Mark precision and recall of detected contacts, over all scenarios if there are several."""
    return [
        IntervalMark(
            f"{what}; {line['noise']}, human error {line['human_error_scale']:g}",
            line["contact_source"],
            (line["noise_mm"], line["noise_deg"]),
            format_noise_label(line["noise_mm"], line["noise_deg"], line["noise"]),
            *[line[what]] * 3,  # value without an interval
        )
        for line in [line for line in lines if line["scenario"] == ALL] or lines
        for what in ("precision", "recall")
        if line[what] is not None
    ]


def _draw_times(lines: Sequence[Line]) -> list[IntervalMark]:
    """Mark median, 5th and 95th percentile of the time of a trial."""
    names = ("trial_median_s", "trial_5_s", "trial_95_s")
    return [IntervalMark(line["scenario"], *[line["method"]] * 3, *(line[name] for name in names)) for line in lines]


def _draw_over_reobservations(results: Sequence[ConditionResult]) -> list[IntervalMark]:
    """Mark success of all methods, if trials with several limits of reobservations exist."""
    several = len({c.max_reobservations for c in results if may_reobserve(c.method)}) > 1
    return [
        IntervalMark(
            c.setting.with_default("max_reobservations").title,
            f"{c.method}, {c.noise_words}",
            c.max_reobservations,
            f"{c.max_reobservations}",
            c.rate,
            *c.interval,
        )
        for c in results
        if several and c.rate is not None and not knows_truth(c.method)
    ]


def _draw_over_tightness(results: Sequence[ConditionResult]) -> list[IntervalMark]:
    """Mark success of all clearances in one panel, if a scenario has several clearances."""
    several = len({(c.scenario, c.clearance_mm) for c in results}) > len({c.scenario for c in results})
    return [
        IntervalMark(
            replace(c.setting, clearance_mm=0.0).title, c.method, c.tightness, f"{c.tightness:g}", c.rate, *c.interval
        )
        for c in results
        if several and c.tightness and c.rate is not None and not knows_truth(c.method)
    ]


def _draw_stages(by_setting: Mapping[Condition, Sequence[ConditionResult]]) -> dict[str, Shares]:
    """Return a bar for every condition: success, then the stages of failures."""
    bars = {
        s.title: {f"{c.method}, {c.noise_words}": _count_endings(c) for c in own if c.trials}
        for s, own in by_setting.items()
    }
    return {title: own for title, own in bars.items() if own}


def _count_endings(result: ConditionResult) -> dict[str, int]:
    """Return success and stages of failures of a condition -> number of trials."""
    counts = {"success": result.successes} if result.successes else {}
    for why, count in result.failures.items():
        stage = why.partition(":")[0]
        counts[stage] = counts.get(stage, 0) + count
    return counts


def _draw_predictions(lines: Sequence[Line]) -> dict[str, Shares]:
    """Return a bar for every scenario and method: combinations of prediction and result."""
    kinds = ("fit_fitted", "fit_failed", "fail_fitted", "fail_failed")
    bars = {
        f"{line['scenario']}, {line['method']}": {kind.replace("_", ": "): line[f"predicted_{kind}"] for kind in kinds}
        for line in lines
        if line["executed"]
    }
    return {"predicted: result": bars} if bars else {}


def _make_mark(setting: Condition, condition: Condition, value: float, low: float, high: float) -> IntervalMark:
    """Return the mark of a value with its interval at the noise level of a condition."""
    level = (condition.noise_mm, condition.noise_deg)
    return IntervalMark(setting.title, condition.method, level, format_noise(level, setting.noise), value, low, high)
