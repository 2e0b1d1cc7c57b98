"""Precision and recall over the noise level, one line for each way of recognising."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from apo_bench.records.settings import RANGE
from apo_bench.report.figures.levels import DODGE, Style, legend, level_axis
from apo_bench.report.tables.recognised import ALL, Recognition
from apo_bench.statistics.rate_text import level_label

STYLES = {
    "recognised": Style("#009E73", "o", "-"),
    "recognised-fixed": Style("#D55E00", "s", (0, (4, 1.5))),
    "recognised-twice": Style("#0072B2", "^", (0, (1, 1))),
}
PANELS = (("precision", "precision"), ("recall", "recall"), ("complete", "demonstrations all right"))


def draw_recognitions(found: Sequence[Recognition], path: Path) -> None:
    """Write the figure as PNG: over all scenarios where there are several, a row of panels for each carelessness."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [r for r in found if r.place.scenario == ALL] or list(found)
    rows = sorted({(r.place.noise, r.place.eye, r.place.careless) for r in shown})
    figure = Figure(figsize=(0.9 + 4.0 * len(PANELS), 1.0 + 2.9 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(rows), len(PANELS), squeeze=False)
    for across, (noise, eye, careless) in zip(axes, rows, strict=True):
        here = [r for r in shown if (r.place.noise, r.place.eye, r.place.careless) == (noise, eye, careless)]
        across[0].set_ylabel(f"{'range finder' if eye == RANGE else noise}, careless {careless:g}")
        for axis, (what, title) in zip(across, PANELS, strict=True):
            axis.set_title(title, fontsize=10)
            _panel(axis, here, what)
    figure.supxlabel(level_axis(noise for noise, _, _ in rows), fontsize=10)
    legend(figure, axes, len(PANELS))
    figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.15)


def _panel(axis: Any, here: Sequence[Recognition], what: str) -> None:
    levels = sorted({(r.place.level, r.place.level_deg) for r in here})
    kinds = [kind for kind in STYLES if any(r.place.relations == kind for r in here)]
    for i, kind in enumerate(kinds):
        line = sorted((r for r in here if r.place.relations == kind), key=lambda r: r.place.level)
        x = [levels.index((r.place.level, r.place.level_deg)) + DODGE * (i - (len(kinds) - 1) / 2) for r in line]
        style = STYLES[kind]
        shape = {"color": style.color, "marker": style.marker, "linestyle": style.dashes, "markersize": 5}
        axis.plot(x, [_value(r, what) for r in line], linewidth=1.6, label=kind, clip_on=False, **shape)
    measured = all(r.place.eye == RANGE for r in here)
    axis.set_xticks(range(len(levels)), [f"{mm:g}" if measured else level_label(mm, deg) for mm, deg in levels])
    axis.set_xlim(-0.4, max(len(levels) - 1, 0) + 0.4)
    low = min((_value(r, what) for r in here), default=0.0)
    axis.set_ylim(0.0 if low < 0.6 else 0.6 if low < 0.9 else 0.9, 1.0)
    axis.yaxis.set_major_formatter(lambda y, _: f"{100 * y:.0f} %")
    axis.grid(axis="y", alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def _value(r: Recognition, what: str) -> float:
    """NaN where nothing was recognised: matplotlib leaves it out."""
    value = r.complete / r.demonstrations if what == "complete" else getattr(r, what)
    return float("nan") if value is None else float(value)
