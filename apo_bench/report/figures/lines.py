"""A panel of lines with bands: methods over levels, or whatever else is over whatever else."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from apo_bench.report.figures.sheet import DPI, INK, RULE, SOFT, Entry, Panel, Style, Tips

_DODGE = 0.08
_WITHIN = 0.4
"""Methods stand this far from each other at one level, so that equal values do not hide each other; and all of them
within this part of the way to the next level."""
_LIFT = 1.8
_RANGE = 8.0
"""For the same reason lines stand this far above each other, and all of them within this range, in px."""


class Point(NamedTuple):
    """A value with its interval, and what is said of it when it is pointed at."""

    x: float
    value: float
    low: float
    high: float
    tip: str


class MethodLine(NamedTuple):
    """The points of a method, from left to right."""

    name: str
    style: Style
    points: Sequence[Point]


class Axis(NamedTuple):
    """From where to where, with ticks and their labels."""

    label: str
    low: float
    high: float
    ticks: Sequence[tuple[float, str]]
    logarithmic: bool = False


class RuleLine(NamedTuple):
    """A line across a panel."""

    at: float
    dashed: bool = False
    tip: str = ""


def line_panel(title: str, x: Axis, y: Axis, lines: Sequence[MethodLine], rule: RuleLine | None = None) -> Panel:
    """Lines with bands; a line of one point has a bar instead."""

    def draw(axis: Any, tip: Tips) -> None:
        _scaffold(axis, x, y)
        if rule is not None:
            drawn = axis.axhline(
                rule.at, linewidth=1.2, **{"color": SOFT, "linestyle": (0, (4, 3))} if rule.dashed else {"color": INK}
            )
            if rule.tip:
                tip(drawn, [rule.tip])
        for line in lines:
            _band(axis, line)
        step = min(_LIFT, _RANGE / max(len(lines), 1))
        for i, line in enumerate(lines):
            tip(
                _marks(axis, line, step * ((len(lines) - 1) / 2 - i)),
                [f"{line.name}, {point.tip}" for point in line.points],
            )

    return Panel(title, draw)


def levels_axis(labels: Sequence[str], what: str) -> Axis:
    """Levels side by side at equal distances, since they span decades and zero."""
    return Axis(what, -0.5, len(labels) - 0.5, list(enumerate(labels)))


def dodges(number: int) -> list[float]:
    """How far each of so many methods stands from its level."""
    step = min(_DODGE, _WITHIN / number) if number else 0.0
    return [step * (i - (number - 1) / 2) for i in range(number)]


def entries(looks: Mapping[str, Style], ceiling: bool = False) -> list[Entry]:
    """A legend: one per method, and one for the oracle."""
    oracle = {"oracle": Style(SOFT, "", (0, (4, 3)))} if ceiling else {}
    return [Entry(name, partial(_sample, style=style)) for name, style in (*looks.items(), *oracle.items())]


def _sample(axis: Any, style: Style) -> None:
    axis.plot([1, 25], [7, 7], color=style.color, linestyle=style.dashes, linewidth=1.7)
    axis.plot([13], [7], color=style.color, marker=style.marker, markersize=7)


def _scaffold(axis: Any, x: Axis, y: Axis) -> None:
    """Grid, labels and names; ticks of matplotlib would take half of the time."""
    axis.set_axis_off()
    axis.set(
        xlim=(x.low, x.high),
        ylim=(y.low, y.high),
        **{f"{name}scale": "log" for name, axis_of in (("x", x), ("y", y)) if axis_of.logarithmic},
    )
    axis.hlines([at for at, _ in y.ticks], x.low, x.high, color=RULE, linewidth=1, zorder=0)
    crowded = sum(len(label) for _, label in x.ticks) + 2 * len(x.ticks) > 52
    below = axis.get_xaxis_transform()
    beside = axis.get_yaxis_transform()
    for at, label in x.ticks:
        axis.text(at, -0.03, label, ha="center", va="top", fontsize=8 if crowded else 10, transform=below)
    for at, label in y.ticks:
        axis.text(-0.015, at, label, ha="right", va="center", transform=beside)
    axis.text(0.5, -0.2, x.label, ha="center", va="bottom", transform=axis.transAxes)
    axis.text(-0.15, 0.5, y.label, ha="center", va="center", rotation=90, transform=axis.transAxes)


def _band(axis: Any, line: MethodLine) -> None:
    if len(line.points) == 1:
        (p,) = line.points
        axis.vlines(p.x, p.low, p.high, color=line.style.color, linewidth=1.4, alpha=0.6)
    elif line.points:
        at, low, high = ([getattr(p, name) for p in line.points] for name in ("x", "low", "high"))
        axis.fill([*at, *at[::-1]], [*low, *high[::-1]], color=line.style.color, alpha=0.13, linewidth=0)


def _marks(axis: Any, line: MethodLine, lift: float) -> Any:
    from matplotlib.transforms import ScaledTranslation

    at = [p.x for p in line.points]
    values = [p.value for p in line.points]
    color, marker, dashes = line.style
    shared = {
        "color": color,
        "clip_on": False,
        "transform": axis.transData + ScaledTranslation(0.0, lift / DPI, axis.figure.dpi_scale_trans),
    }
    axis.plot(at, values, linestyle=dashes, linewidth=1.7, **shared)
    thin = marker == "1" or isinstance(marker, tuple)  # a white edge would cover most of them
    (marks,) = axis.plot(at, values, marker=marker, linestyle="", markersize=8.0 if thin else 6.5, **shared)
    marks.set(markeredgecolor=color if thin else "#ffffff", markeredgewidth=0.6)
    return marks
