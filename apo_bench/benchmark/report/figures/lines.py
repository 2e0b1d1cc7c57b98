"""Draw line figures: a value of every method, with an interval band, over a setting."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.benchmark.report.figures.sheet import Figure, FigurePanel, draw_figure
from apo_bench.benchmark.report.figures.style import Style, assign_styles
from apo_bench.io import group_by

_APART = 0.08
_WITHIN = 0.4
"""Methods are shifted by `_APART` of the distance between two values of the axis, so that equal ones stay visible.

All shifts together are at most `_WITHIN` of that distance.
"""


class IntervalMark(NamedTuple):
    """A value with its interval, and its position in a figure."""

    panel: str
    line: str
    at: Any
    """Its position on the horizontal axis; distinct positions are sorted and drawn at equal distances."""
    label: str
    """Label of the position on the axis."""
    value: float
    low: float
    high: float


class Axes(NamedTuple):
    """Labels of the axes, and the scale of the vertical one."""

    x: str
    y: str
    kind: str = "plain"
    """`percent` from 0 to 100 %, `points` around a line at 0, `log`, or `plain`."""


def draw_lines(title: str, marks: Sequence[IntervalMark], axes: Axes) -> Figure:
    """Draw a panel for each name that marks have, with a line for each method."""
    looks = assign_styles(list(dict.fromkeys(mark.line for mark in marks)))
    panels = group_by((mark.panel, mark) for mark in marks)
    return draw_figure(
        title, [_draw_panel(name, own, axes, looks) for name, own in panels.items()], _make_legend(looks)
    )


def _draw_panel(title: str, marks: Sequence[IntervalMark], axes: Axes, looks: dict[str, Style]) -> FigurePanel:
    """Return a panel with the lines of its marks."""
    conditions = {at: i for i, at in enumerate(sorted({mark.at for mark in marks}))}
    labels = {conditions[mark.at]: mark.label for mark in marks}
    lines = group_by((mark.line, mark) for mark in marks)
    step = min(_APART, _WITHIN / len(lines))

    def draw_lines(axis: Any) -> None:
        for i, (name, own) in enumerate(lines.items()):
            x = np.array([conditions[mark.at] for mark in own]) + step * (i - (len(lines) - 1) / 2)
            _draw_line(axis, x, own, looks[name])
        axis.set_xticks(list(labels), list(labels.values()))
        axis.set_xlim(-0.5, len(conditions) - 0.5)
        axis.set(xlabel=axes.x, ylabel=axes.y)
        _set_scale(axis, axes.kind)

    return FigurePanel(title, draw_lines)


def _draw_line(axis: Any, x: Any, marks: Sequence[IntervalMark], style: Style) -> None:
    """Draw a line with its interval band; a single mark has an interval bar."""
    order = np.argsort(x, kind="stable")
    value, low, high = np.array([mark[-3:] for mark in marks], dtype=float)[order].T  # the last three fields
    axis.plot(x[order], value, color=style.color, marker=style.marker, linestyle=style.dashes, markersize=6, zorder=3)
    if len(marks) == 1:
        axis.vlines(x, low, high, color=style.color, alpha=0.6)
    else:
        axis.fill_between(x[order], low, high, color=style.color, alpha=0.13, linewidth=0)


def _set_scale(axis: Any, kind: str) -> None:
    """Set the scale of the vertical axis: `percent`, `points`, `log` or `plain`."""
    if kind == "percent":
        axis.set_ylim(-0.02, 1.02)
        axis.set_yticks((0.0, 0.25, 0.5, 0.75, 1.0), ("0 %", "25 %", "50 %", "75 %", "100 %"))
    elif kind == "points":
        axis.axhline(0.0, linewidth=1.0, color="black")
        axis.yaxis.set_major_formatter(lambda y, _: f"{100 * y:+.0f}")
    elif kind == "log":
        axis.set_yscale("log")
        # matplotlib's own logarithmic labels are formulas, which figures here do not parse
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("")


def _make_legend(looks: dict[str, Style]) -> dict[str, Any]:
    """Return name -> sample of the line for the legend."""
    from matplotlib.lines import Line2D

    return {
        name: Line2D([], [], color=style.color, marker=style.marker, linestyle=style.dashes)
        for name, style in looks.items()
    }
