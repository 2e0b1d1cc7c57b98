"""The figure of the headline: success over the error of the poses, and two panels of limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from apo_bench.benchmark.analysis import Rate
from apo_bench.benchmark.report.figures.style import INK, RULE, SOFT
from benchmarks.headline_summary import NOISE, NOISES, WORDS, Summary, pool, robot_rate

COLOURS = {
    "uncorrected": "#d55e00",
    "spiral-search": "#c2186f",
    "contact-robust": "#332288",
    "contact": "#332288",
    "oracle": SOFT,
    "contact-robust+spiral": "#00745a",
}
LINES = ("uncorrected", "spiral-search", "snap", "nominal")
DASHES: Any = {"snap": (0, (4, 2)), "nominal": (0, (1, 1.2))}
FONT = 12.5
NAME_HEIGHT = 5.5  # of a name beside a line, in percent of the axis


def draw_summary(summary: Summary, path: Path) -> None:
    """Draw success over the noise level, and the panels of limits."""
    settings: Any = {"font.size": FONT, "font.family": "DejaVu Sans", "text.color": INK, "axes.edgecolor": RULE}
    with plt.rc_context(settings):
        figure = plt.figure(figsize=(11.0, 6.6), layout="constrained")
        places = figure.add_gridspec(2, 2, width_ratios=(1.12, 1.0), height_ratios=(1.1, 1.0))
        draw_noise_levels(figure.add_subplot(places[:, 0]), summary)
        draw_outliers(figure.add_subplot(places[0, 1]), summary)
        draw_robot_errors(figure.add_subplot(places[1, 1]), summary)
        figure.savefig(path, dpi=130)
        plt.close(figure)


def draw_noise_levels(axis: Any, summary: Summary) -> None:
    """Draw lines over the noise level; names stand at the left, where falling lines are apart."""
    methods = (*LINES, summary.corrected)
    plain = [cell for cell in summary.cells if cell.human_error_scale == 0.0 and cell.method in methods]
    levels = sorted({cell.noise_mm for cell in plain if cell.noise_mm > 0.0})
    names = list[tuple[float, str]]()
    for method in methods:
        drawn = [(k, rate) for k, level in enumerate(levels) if (rate := pool(summary.cells, method, level))]
        loud = method in COLOURS
        draw_line(axis, drawn, COLOURS.get(method, SOFT), 2.8 if loud else 1.6, DASHES.get(method, "-"), band=loud)
        if method == summary.corrected:
            label = {"color": COLOURS[method], "fontweight": "bold", "va": "top", "ha": "center"}
            axis.text(len(levels) / 2, 95, WORDS[method], **label)
        elif drawn:
            names.append((percents(drawn)[0], method))
    for height, (_, method) in zip(spread([y for y, _ in sorted(names)]), sorted(names), strict=True):
        label = {"color": COLOURS.get(method, SOFT), "fontweight": "bold", "va": "center", "ha": "right"}
        axis.text(-0.2, height, WORDS[method], **label)
    axis.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
    axis.set_xlim(-2.3, len(levels) - 0.8)
    axis.set_xlabel("error of the observed poses [mm and degrees]")
    axis.set_title("Observed, searched, corrected", loc="left", fontweight="bold", fontsize=FONT + 2)
    scale_to_percent(axis)


def spread(heights: Sequence[float]) -> list[float]:
    """Return heights in rising order, moved down from the top until names there do not touch."""
    placed: list[float] = []
    for height in reversed(heights):
        placed.append(min(height, placed[-1] - NAME_HEIGHT if placed else 100.0))
    return placed[::-1]


def draw_outliers(axis: Any, summary: Summary) -> None:
    """Draw bars by noise and method, with their percentages."""
    y = 0.0
    ticks = list[float]()
    names = list[str]()
    for noise, title in NOISES.items():
        axis.text(0, y, title, va="center", fontweight="bold", fontsize=FONT - 1.5)
        y -= 1
        for method in ("uncorrected", "paper", "contact", "contact-robust"):
            rate = pool(summary.cells, method, NOISE, noise=noise)
            if rate is None:
                continue
            value = 100 * rate.successes / rate.trials
            low, high = (100 * x for x in rate.interval)
            color = COLOURS[method] if method == summary.corrected else "#9aa3b2"
            axis.barh(y, value, height=0.72, color=color)
            axis.plot([low, high], [y, y], color=INK, linewidth=1.2)
            axis.text(max(high, value) + 2, y, f"{value:.0f} %", va="center", fontsize=FONT - 1)
            ticks.append(y)
            names.append(method)
            y -= 1
        y -= 0.4
    axis.set_yticks(ticks, names, fontsize=FONT - 1)
    axis.set_ylim(y + 0.6, 0.6)
    axis.set_xlim(0, 118)
    axis.set_xticks([])
    axis.set_title("Limits: outliers", pad=10, loc="left", fontweight="bold", fontsize=FONT + 2)
    axis.tick_params(length=0)
    axis.spines[["top", "right", "bottom"]].set_visible(False)


def draw_robot_errors(axis: Any, summary: Summary) -> None:
    """Draw lines over the robot's own error."""
    kinds = {cell.robot_error for cell in summary.cells if cell.robot_error.startswith("hand_eye:")}
    errors = ["none", *sorted(kinds, key=size_mm)]
    places = {
        summary.corrected: (0.03, 0.22, "left"),
        f"{summary.corrected}+spiral": (0.99, 0.93, "right"),
        "oracle": (0.03, 0.08, "left"),
    }
    for method, (x, y, side) in places.items():
        drawn = [(k, rate) for k, error in enumerate(errors) if (rate := robot_rate(summary, method, error))]
        color = COLOURS.get(method, SOFT)
        draw_line(axis, drawn, color, 2.6, (0, (1.2, 1.2)) if method == "oracle" else "-", band=True)
        axis.text(x, y, WORDS.get(method, method), color=color, fontweight="bold", ha=side, transform=axis.transAxes)
    axis.set_xticks(range(len(errors)), ["0", *(f"{size_mm(error):g}" for error in errors[1:])])
    axis.set_xlabel("hand-eye error [mm, and 0.2 degrees per mm]")
    axis.set_title("Limits: the robot's own error", loc="left", fontweight="bold", fontsize=FONT + 2)
    axis.set_xlim(-0.15, len(errors) - 0.85)
    scale_to_percent(axis)


def size_mm(error: str) -> float:
    """Return the millimetres of `hand_eye:0.5/0.1`."""
    return float(error.partition(":")[2].partition("/")[0])


def draw_line(
    axis: Any, drawn: Sequence[tuple[int, Rate]], color: str, width: float, dashes: Any, *, band: bool
) -> None:
    """Draw a line, and the band of its 95 % intervals."""
    at = [k for k, _ in drawn]
    axis.plot(at, percents(drawn), color=color, linewidth=width, linestyle=dashes, marker="o", clip_on=False)
    if band:
        low, high = ([100 * getattr(rate.interval, side) for _, rate in drawn] for side in ("low", "high"))
        axis.fill_between(at, low, high, color=color, alpha=0.12, linewidth=0)


def percents(drawn: Sequence[tuple[int, Rate]]) -> list[float]:
    """Return success rates in percent."""
    return [100 * rate.successes / rate.trials for _, rate in drawn]


def scale_to_percent(axis: Any) -> None:
    """Let the axis of success run from 0 to 100 %."""
    axis.set_ylim(-2, 103)
    axis.set_yticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100 %"])
    axis.grid(axis="y", color=RULE)
    axis.tick_params(length=0)
    axis.spines[["top", "right"]].set_visible(False)
