"""Success over tightness, clearance over level: how much room a part has for what the camera errs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from apo_bench.records.method import knows_truth
from apo_bench.report.figures.levels import legend, rows_of, styles
from apo_bench.statistics.rates import Cell

DODGE = 1.03
"""Methods stand this factor from each other at one tightness, so that equal rates do not hide each other."""


def varies(cells: Sequence[Cell]) -> bool:
    """Whether there is more than one clearance for a scenario, and a level above zero."""
    swept = {(c.scenario, c.clearance_mm) for c in cells}
    return len(swept) > len({scenario for scenario, _ in swept}) and any(c.tightness for c in cells)


def draw_tightness(cells: Sequence[Cell], path: Path) -> None:
    """Write the figure as PNG: panels as in the figure over level; a line per method and level."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    seen = [c for c in cells if not knows_truth(c.method) and c.tightness and c.rate is not None]
    rows = list(dict.fromkeys(row._replace(clearance_mm=None) for row in rows_of(cells)))
    lines = list(dict.fromkeys(row._replace(relations="given") for row in rows))
    careless = sorted({c.careless for c in seen})
    columns = [(relations, f) for relations in dict.fromkeys(row.relations for row in rows) for f in careless]
    figure = Figure(figsize=(0.9 + 4.3 * len(columns), 1.0 + 3.1 * len(lines)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(lines), len(columns), squeeze=False, sharey=True)
    for i, line in enumerate(lines):
        for j, (relations, f) in enumerate(columns):
            row = line._replace(relations=relations)
            if row not in rows:
                axes[i][j].set_axis_off()
                continue
            axes[i][j].set_title(row.title(f), fontsize=10)
            _panel(axes[i][j], [c for c in seen if c.careless == f and row.holds(c)])
        axes[i][0].set_ylabel("success")
    figure.supxlabel("tightness: clearance per side over level [mm per mm]", fontsize=10)
    legend(figure, axes, len(columns))
    figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.15)


def _panel(axis: Any, cells: Sequence[Cell]) -> None:
    methods = list(dict.fromkeys(c.method for c in cells))
    for i, (method, style) in enumerate(styles(methods).items()):
        aside = DODGE ** (i - (len(methods) - 1) / 2)
        shape = {"color": style.color, "marker": style.marker, "linestyle": style.dashes, "linewidth": 1.2}
        for level in sorted({(c.level, c.level_deg) for c in cells if c.method == method}):
            line = [c for c in cells if c.method == method and (c.level, c.level_deg) == level]
            x, y = [(c.tightness or 0.0) * aside for c in line], [float(c.rate or 0.0) for c in line]
            bars = [[r - c.interval.low for r, c in zip(y, line, strict=True)]]
            bars += [[c.interval.high - r for r, c in zip(y, line, strict=True)]]
            axis.errorbar(x, y, yerr=bars, color=style.color, fmt="none", capsize=2, linewidth=0.8, alpha=0.6)
            axis.plot(x, y, markersize=5, label=method, clip_on=False, **shape)
    if cells:
        axis.set_xscale("log")
        ticks = sorted({c.tightness for c in cells if c.tightness})
        axis.set_xticks(ticks, [f"{x:g}" for x in ticks], fontsize=8)
        axis.minorticks_off()
    axis.set_ylim(-0.04, 1.06)
    axis.yaxis.set_major_formatter(lambda y, _: f"{100 * y:.0f} %")
    axis.grid(axis="y", alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)
