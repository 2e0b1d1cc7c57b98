"""The figure of the headline: success over the noise level, and what limits it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from apo_bench.benchmark.analysis import Rate
from apo_bench.benchmark.report.figures.style import INK, RULE, SOFT
from apo_bench.records import TrialConfig
from benchmarks.headline_summary import NOISE, NOISES, Summary, pool, robot_rate

STYLES = {
    "uncorrected": ("#d55e00", "o", "-"),
    "spiral-search": ("#c2186f", "s", "-"),
    "snap": ("#a6761d", "^", "--"),
    "nominal": ("#7a7a1f", "D", ":"),
    "paper": ("#0072b2", "v", "--"),
    "contact": ("#00745a", "P", "-."),
    "contact-robust": ("#332288", "o", "-"),
    "contact-robust+spiral": ("#00745a", "X", "-"),
    "oracle": (SOFT, "*", "--"),
}
"""Colour, marker and dashes of a method."""
OUTLIERS = ("uncorrected", "paper", "contact", "contact-robust")
FONT = 12.0
NAME_HEIGHT = 5.5  # of a name next to a line, in percent of the axis
THIN, WIDER = (
    1.6,
    2.4,
)  # width of a line, and how much wider it is for every later line that coincides with it, in points


def draw_summary(summary: Summary, path: Path) -> None:
    """Draw success over the noise level without and with human error, and two panels of limits."""
    settings: Any = {"font.size": FONT, "text.color": INK, "axes.edgecolor": RULE, "svg.hashsalt": "headline"}
    with plt.rc_context(settings):
        figure, axes = plt.subplots(2, 2, figsize=(12.5, 10.0), layout="constrained", height_ratios=(1.2, 1.0))
        draw_noise_levels(axes[0, 0], summary)
        draw_human_error(axes[0, 1], summary)
        draw_outliers(axes[1, 0], summary)
        draw_robot_errors(axes[1, 1], summary)
        figure.get_layout_engine().set(wspace=0.06, hspace=0.05)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


def draw_noise_levels(axis: Any, summary: Summary) -> None:
    """Draw every method over the noise level, without human error; the oracle has none."""
    plain = [cell for cell in summary.cells if _is_plain(cell) and cell.human_error_scale == 0.0]
    levels = sorted({cell.noise_mm for cell in plain})
    lines = {
        method: [(k, rate) for k, level in enumerate(levels) if (rate := pool(summary.cells, method, level))]
        for method in STYLES
        if method in {cell.method for cell in plain} and "+" not in method
    }
    draw_lines(axis, lines)
    axis.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
    axis.set_xlim(-0.3, len(levels) + 2.1)
    axis.set_xlabel("noise [mm and degrees, 1 sigma per axis]", loc="left")
    set_title(axis, "All methods over the noise level")


def draw_human_error(axis: Any, summary: Summary) -> None:
    """Write the success of every method that ran with human error into a table whose cells are shaded."""
    shaky = [cell for cell in summary.cells if _is_plain(cell) and cell.human_error_scale == 1.0]
    levels = sorted({cell.noise_mm for cell in shaky})
    shares = np.full((len({cell.method for cell in shaky}), len(levels)), np.nan)
    methods = sorted({cell.method for cell in shaky}, key=lambda method: (_success(shaky, method, 2.0), method))
    for i, method in enumerate(methods):
        for j, level in enumerate(levels):
            shares[i, j] = _success(shaky, method, level)
            if not np.isnan(shares[i, j]):
                color = "white" if shares[i, j] > 60 else INK
                axis.text(j, i, f"{shares[i, j]:.0f}", ha="center", va="center", color=color)
    axis.pcolormesh(shares, cmap="Purples", vmin=0, vmax=130, edgecolors="white", linewidth=2)
    for text in axis.texts:
        text.set_position(np.array(text.get_position()) + 0.5)
    axis.set_yticks(np.arange(len(methods)) + 0.5, methods)
    axis.set_xticks(np.arange(len(levels)) + 0.5, [f"{level:g}" for level in levels])
    axis.set_xlabel("noise [mm and degrees]; empty: not run", loc="left")
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    set_title(axis, "With human error: success [%]")


def _is_plain(cell: Any) -> bool:
    return bool(cell.noise == TrialConfig.noise and cell.robot_error == TrialConfig.robot_error)


def _success(cells: Sequence[Any], method: str, noise_mm: float) -> float:
    """Return the success over scenarios in percent; not a number where the method did not run."""
    own = [cell for cell in cells if (cell.method, cell.noise_mm) == (method, noise_mm)]
    trials = sum(cell.trials for cell in own)
    return 100 * sum(cell.successes for cell in own) / trials if trials else float("nan")


def spread(heights: Sequence[float], gap: float = NAME_HEIGHT) -> list[float]:
    """Return heights in rising order, moved down from the top until they are a gap apart."""
    placed: list[float] = []
    for height in reversed(heights):
        placed.append(min(height, placed[-1] - gap if placed else height))
    return placed[::-1]


def draw_outliers(axis: Any, summary: Summary) -> None:
    """Draw bars by noise and method, with their percentages and intervals."""
    y = 0.0
    ticks: dict[float, str] = {}
    for noise, title in NOISES.items():
        axis.text(0, y, title, va="center", fontweight="bold", fontsize=FONT - 1)
        y -= 1
        for method in OUTLIERS:
            rate = pool(summary.cells, method, NOISE, noise=noise)
            if rate is None:
                continue
            low, high = (100 * x for x in rate.interval)
            value = 100 * rate.successes / rate.trials
            axis.barh(y, value, height=0.72, color=STYLES[method][0], alpha=0.85)
            axis.plot([low, high], [y, y], color=INK, linewidth=1.2)
            axis.text(max(high, value) + 2, y, f"{value:.0f} %", va="center")
            ticks[y] = method
            y -= 1
        y -= 0.4
    axis.set_yticks(list(ticks), list(ticks.values()))
    axis.set_ylim(y + 0.6, 0.6)
    axis.set_xlim(0, 112)
    axis.set_xticks([0, 25, 50, 75, 100])
    axis.set_xlabel(f"success [%] at {NOISE:g} mm and {NOISE:g} degree", loc="left")
    axis.tick_params(length=0)
    axis.spines[["top", "right", "bottom"]].set_visible(False)
    set_title(axis, "Limits: outliers")


def draw_robot_errors(axis: Any, summary: Summary) -> None:
    """Draw lines over the robot's own error."""
    kinds = {cell.robot_error for cell in summary.cells if cell.robot_error.startswith("hand_eye:")}
    errors = ["none", *sorted(kinds, key=size_mm)]
    lines = {
        method: [(k, rate) for k, error in enumerate(errors) if (rate := robot_rate(summary, method, error))]
        for method in ("oracle", summary.corrected, f"{summary.corrected}+spiral")
    }
    draw_lines(axis, {method: drawn for method, drawn in lines.items() if drawn})
    axis.set_xticks(range(len(errors)), ["0", *(f"{size_mm(error):g}" for error in errors[1:])])
    axis.set_xlabel("hand-eye error [mm, and 0.2 degrees per mm]", loc="left")
    axis.set_xlim(-0.15, len(errors) + 1.6)
    set_title(axis, "Limits: the robot's own error")


def size_mm(error: str) -> float:
    """Return the millimetres of `hand_eye:0.5/0.1`."""
    return float(error.partition(":")[2].partition("/")[0])


def draw_lines(axis: Any, lines: Mapping[str, Sequence[tuple[int, Rate]]]) -> None:
    """Draw a line with the band of its 95 % intervals for each method, and its name where it ends.

    Lines that coincide lie on each other, the thinner on the wider, at their true heights.
    """
    ends = sorted((drawn[-1][0], percent(drawn[-1][1]), method) for method, drawn in lines.items())
    methods = list(lines)
    for k, (method, drawn) in enumerate(lines.items()):
        color, marker, dashes = STYLES[method]
        at = [each for each, _ in drawn]
        heights = [percent(rate) for _, rate in drawn]
        above = sum(_coincide(drawn, lines[other]) for other in methods[k + 1 :])
        style = {"linewidth": THIN + WIDER * above, "linestyle": "-" if above else dashes}
        axis.plot(at, heights, color=color, marker=marker, markersize=6 + 2.5 * above, clip_on=False, **style)
        low, high = ([100 * getattr(rate.interval, side) for _, rate in drawn] for side in ("low", "high"))
        axis.fill_between(at, low, high, color=color, alpha=0.10, linewidth=0)
    for last in {k for k, _, _ in ends}:
        group = sorted((height, method) for k, height, method in ends if k == last)
        names = spread([min(y, 100.0) + NAME_HEIGHT * (last == 0) for y, _ in group])
        for height, (_, method) in zip(names, group, strict=True):
            label = {"color": STYLES[method][0], "fontweight": "bold", "va": "center", "ha": "left"}
            axis.text(last + 0.2 * (last > 0), height, method, **label)
    axis.set_ylim(-15, 108)
    axis.set_yticks([0, 25, 50, 75, 100])
    axis.set_ylabel("success [%]")
    axis.grid(axis="y", color=RULE)
    axis.tick_params(length=0)
    axis.spines[["top", "right"]].set_visible(False)


def _coincide(drawn: Sequence[tuple[int, Rate]], other: Sequence[tuple[int, Rate]]) -> bool:
    """Return whether two lines share at least two points, to 1.5 percent."""
    heights = {k: percent(rate) for k, rate in other}
    return sum(abs(percent(rate) - heights.get(k, np.inf)) < 1.5 for k, rate in drawn) >= 2


def percent(rate: Rate) -> float:
    """Return a success rate in percent."""
    return 100 * rate.successes / rate.trials


def set_title(axis: Any, title: str) -> None:
    """Set the title of a panel, at its left."""
    axis.set_title(title, loc="left", fontweight="bold", fontsize=FONT + 2)
