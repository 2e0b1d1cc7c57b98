"""Success over level: a panel per scenario and carelessness, a line with its interval per method."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from apo_bench.benchmark.statistics import Cell

COLORS = {"none": "#D55E00", "paper": "#0072B2"}
OTHERS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
CEILING = "#444444"


def draw(cells: Sequence[Cell], path: Path) -> None:
    """Write the figure as PNG; no display is needed."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    swept = [cell for cell in cells if cell.method != "oracle"]
    clearances = sorted({(c.scenario, c.clearance_mm) for c in cells})
    careless = sorted({c.careless for c in swept}) or [0.0]
    columns, lines = len(careless), len(clearances)
    figure = Figure(figsize=(0.9 + 4.3 * columns, 1.0 + 3.1 * lines), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(lines, columns, squeeze=False, sharey=True)
    for i, (scenario, clearance) in enumerate(clearances):
        mine = [c for c in cells if (c.scenario, c.clearance_mm) == (scenario, clearance)]
        for j, f in enumerate(careless):
            human = "careful human" if f == 0 else f"carelessness {f:g}"
            axes[i][j].set_title(f"{scenario}, {human}, {clearance:g} mm clearance", fontsize=10)
            _panel(axes[i][j], mine, f)
        axes[i][0].set_ylabel("strict success")
    figure.supxlabel("level: standard deviation of the seen poses [mm and degrees]", fontsize=10)
    handles = {label: h for axis in axes.flat for h, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(
        handles.values(), handles.keys(), loc="outside upper center", ncols=max(1, len(handles)), frameon=False
    )
    figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.15)


def _panel(axis: Any, cells: Sequence[Cell], careless: float) -> None:
    """One panel: levels side by side at equal distances, since they span two decades and zero."""
    here = [c for c in cells if c.method != "oracle" and c.careless == careless]
    levels = sorted({(c.level, c.level_deg) for c in here})
    place = {level: x for x, level in enumerate(levels)}
    for ceiling in (c for c in cells if c.method == "oracle" and c.rate is not None):
        axis.axhline(ceiling.rate, color=CEILING, linestyle="--", linewidth=1.2, label="oracle")
    for i, method in enumerate(dict.fromkeys(c.method for c in here)):
        line = [c for c in here if c.method == method and c.rate is not None]
        x = [place[c.level, c.level_deg] for c in line]
        color = COLORS.get(method, OTHERS[i % len(OTHERS)])
        axis.fill_between(
            x, [c.interval.low for c in line], [c.interval.high for c in line], color=color, alpha=0.18, linewidth=0
        )
        marker = MARKERS[i % len(MARKERS)]
        rates = [float(c.rate or 0.0) for c in line]
        below = [rate - c.interval.low for rate, c in zip(rates, line, strict=True)]
        above = [c.interval.high - rate for rate, c in zip(rates, line, strict=True)]
        axis.errorbar(x, rates, yerr=[below, above], color=color, fmt="none", capsize=3, linewidth=1.0, alpha=0.8)
        axis.plot(x, rates, color=color, marker=marker, markersize=5, linewidth=1.8, label=method, clip_on=False)
        for at, rate, cell in zip(x, rates, line, strict=True):
            offset = (6, -12) if rate > 0.5 else (6, 6)
            axis.annotate(f"n={cell.trials}", (at, rate), offset, textcoords="offset points", fontsize=6, color=color)
    axis.set_xticks(range(len(levels)), [level_label(*level) for level in levels])
    axis.set_xlim(-0.4, max(len(levels) - 1, 0) + 0.4)
    axis.set_ylim(-0.04, 1.06)
    axis.yaxis.set_major_formatter(lambda y, _: f"{100 * y:.0f} %")
    axis.grid(axis="y", alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def level_label(level: float, level_deg: float) -> str:
    """`0.5`, or `0.5 mm, 1 deg` where the two differ."""
    return f"{level:g}" if level == level_deg else f"{level:g} mm, {level_deg:g} deg"
