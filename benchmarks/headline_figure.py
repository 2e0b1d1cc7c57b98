"""The figure of the headline: success over the error of the poses, and two panels of where the correction breaks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from apo_bench.benchmark.analysis import Rate
from apo_bench.benchmark.report.figures.style import INK, RULE, SOFT
from benchmarks.headline_look import NOISES, TOLD_LEVEL, WORDS, Look, pooled, robot_rate, robot_scenarios

REOBSERVE = {
    "uncorrected": "#d55e00",
    "spiral-search": "#c2186f",
    "contact-robust": "#332288",
    "contact": "#332288",
    "oracle": SOFT,
}
REOBSERVE |= {"contact-robust+spiral": "#00745a"}
LINES = ("uncorrected", "spiral-search", "snap", "nominal")
DASHES: Any = {"snap": (0, (4, 2)), "nominal": (0, (1, 1.2))}
FONT = 12.5
NAME_HEIGHT = 5.5
"""Of a name beside a line, in percent of the axis."""


def draw_look(look: Look, path: Path) -> None:
    """Success over level, and two panels of where it breaks if that was run."""
    settings = {"font.size": FONT, "font.family": "DejaVu Sans", "text.color": INK, "axes.edgecolor": RULE}
    with plt.rc_context(settings):
        broken = any(cell.noise in NOISES for cell in look.cells) and bool(robot_scenarios(look.cells))
        figure = plt.figure(figsize=(11.0, 6.6) if broken else (7.0, 4.6), layout="constrained")
        if broken:
            places = figure.add_gridspec(2, 2, width_ratios=(1.12, 1.0), height_ratios=(1.1, 1.0))
            draw_levels(figure.add_subplot(places[:, 0]), look)
            draw_outliers(figure.add_subplot(places[0, 1]), look)
            draw_robot(figure.add_subplot(places[1, 1]), look)
        else:
            draw_levels(figure.add_subplot(), look)
        figure.savefig(path, dpi=130)
        plt.close(figure)


def draw_levels(axis: Any, look: Look) -> None:
    """Lines over the level; what falls has its name at the left, where the lines are apart."""
    levels = sorted(
        {
            c.noise_mm
            for c in look.cells
            if c.human_error_scale == 0.0 and c.noise_mm > 0 and c.method in (*LINES, look.corrected)
        }
    )
    names: list[tuple[float, str]] = []
    for method in dict.fromkeys((*LINES, look.corrected)):
        points = [(k, pooled(look.cells, method, noise_mm)) for k, noise_mm in enumerate(levels)]
        drawn = [(k, rate) for k, rate in points if rate is not None]
        if not drawn:
            continue
        loud = method in REOBSERVE
        dashes = "-" if loud else DASHES[method]
        draw_line(axis, drawn, REOBSERVE.get(method, SOFT), 2.8 if loud else 1.6, dashes, band=loud)
        if method == look.corrected:
            axis.text(
                len(levels) / 2, 95, WORDS[method], color=REOBSERVE[method], fontweight="bold", va="top", ha="center"
            )
        else:
            names.append((percents(drawn)[0], method))
    for height, (_, method) in zip(apart([y for y, _ in sorted(names)]), sorted(names), strict=True):
        axis.text(
            -0.2, height, WORDS[method], color=REOBSERVE.get(method, SOFT), fontweight="bold", va="center", ha="right"
        )
    axis.set_xticks(range(len(levels)), [f"{noise_mm:g}" for noise_mm in levels])
    axis.set_xlim(-2.1, len(levels) - 0.8)
    axis.set_xlabel("error of the poses seen [mm and degrees]")
    axis.set_title("As seen, searched, corrected", loc="left", fontweight="bold", fontsize=FONT + 2)
    to_percent(axis)


def apart(heights: Sequence[float]) -> list[float]:
    """Heights in rising order, moved so that names there do not touch: down from the top."""
    placed: list[float] = []
    for height in reversed(heights):
        placed.append(min(height, placed[-1] - NAME_HEIGHT if placed else 100.0))
    return placed[::-1]


def draw_outliers(axis: Any, look: Look) -> None:
    """Bars by noise and method, with their percentages."""
    y = 0.0
    ticks = []
    names = []
    for noise, title in NOISES.items():
        axis.text(0, y, title, va="center", fontweight="bold", fontsize=FONT - 1.5)
        y -= 1
        for method in dict.fromkeys(("uncorrected", "paper", "contact", look.corrected)):
            rate = pooled(look.cells, method, TOLD_LEVEL, noise=noise)
            if rate is None:
                continue
            value = 100 * rate.successes / rate.trials
            low, high = (100 * x for x in rate.interval)
            color = REOBSERVE[method] if method == look.corrected else "#9aa3b2"
            axis.barh(y, value, height=0.72, color=color)
            axis.plot([low, high], [y, y], color=INK, linewidth=1.2)
            axis.text(max(high, value) + 2, y, f"{value:.0f} %", va="center", fontsize=FONT - 1)
            ticks.append(y)
            names.append("as seen" if method == "uncorrected" else method)
            y -= 1
        y -= 0.4
    axis.set_yticks(ticks, names, fontsize=FONT - 1)
    axis.set_ylim(y + 0.6, 0.6)
    axis.set_xlim(0, 118)
    axis.set_xticks([])
    axis.set_title("Where it breaks: outliers", pad=10, loc="left", fontweight="bold", fontsize=FONT + 2)
    axis.tick_params(length=0)
    axis.spines[["top", "right", "bottom"]].set_visible(False)


def draw_robot(axis: Any, look: Look) -> None:
    """Lines over the robot's own error: names above the line that falls last, and below the others."""
    kinds = {cell.robot_error for cell in look.cells if cell.robot_error.startswith("hand_eye:")}
    errors = ["none", *sorted(kinds, key=size_mm)]
    places = {"oracle": (0.03, 0.08, "left"), look.corrected: (0.03, 0.22, "left")}
    for method, (x, y, side) in {**places, f"{look.corrected}+spiral": (0.99, 0.93, "right")}.items():
        points = [(k, robot_rate(look, method, error)) for k, error in enumerate(errors)]
        drawn = [(k, rate) for k, rate in points if rate is not None]
        if not drawn:
            continue
        color = REOBSERVE.get(method, SOFT)
        draw_line(axis, drawn, color, 2.6, (0, (1.2, 1.2)) if method == "oracle" else "-")
        axis.text(x, y, WORDS.get(method, method), color=color, fontweight="bold", ha=side, transform=axis.transAxes)
    axis.set_xticks(range(len(errors)), ["0", *(f"{size_mm(error):g}" for error in errors[1:])])
    axis.set_xlabel("robot off by [mm, and 0.2 degrees per mm]")
    axis.set_title("Where it breaks: the robot itself", loc="left", fontweight="bold", fontsize=FONT + 2)
    axis.set_xlim(-0.15, len(errors) - 0.85)
    to_percent(axis)


def size_mm(error: str) -> float:
    """The millimetres of `hand_eye:0.5/0.1`."""
    return float(error.partition(":")[2].partition("/")[0])


def draw_line(
    axis: Any, drawn: Sequence[tuple[int, Rate]], color: str, width: float, dashes: Any, band: bool = True
) -> None:
    """A line, with its band of 95 % if asked for."""
    at = [k for k, _ in drawn]
    axis.plot(at, percents(drawn), color=color, linewidth=width, linestyle=dashes, marker="o", clip_on=False)
    if band:
        low, high = ([100 * getattr(rate.interval, side) for _, rate in drawn] for side in ("low", "high"))
        axis.fill_between(at, low, high, color=color, alpha=0.12, linewidth=0)


def percents(drawn: Sequence[tuple[int, Rate]]) -> list[float]:
    return [100 * rate.successes / rate.trials for _, rate in drawn]


def to_percent(axis: Any) -> None:
    axis.set_ylim(-2, 103)
    axis.set_yticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100 %"])
    axis.grid(axis="y", color=RULE)
    axis.tick_params(length=0)
    axis.spines[["top", "right"]].set_visible(False)
