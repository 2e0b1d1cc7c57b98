"""Panels drawn as SVG: methods over levels, with bands. Sizes in px of a panel 360 wide; fonts scale with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, final

from apo_bench.report.figures.levels import Style
from apo_bench.report.figures.paint import dash, marker
from apo_bench.report.page.markup import Html, html, joined, tag

WIDTH, HEIGHT = 360, 230
LEFT, RIGHT, TOP, BOTTOM = 48, 12, 10, 42
DODGE, SPREAD = 0.05, 0.32
"""Methods stand this far from each other at one level, so that equal values do not hide each other; and all of them
within this part of the way to the next level."""


class Panel(NamedTuple):
    """A drawing with its title."""

    title: str
    drawing: Html
    """What stands inside `<svg>`."""
    height: int = HEIGHT

    def figure(self) -> Html:
        """As it stands in a page: as wide as there is room."""
        box = f"0 0 {WIDTH} {self.height}"
        svg = tag("svg", self.drawing, viewBox=box, role="img", aria_label=self.title, class_="chart")
        return tag("figure", tag("figcaption", self.title), svg, class_="panel")


class Point(NamedTuple):
    """A value over a level, with its interval and what is said of it when it is pointed at."""

    level: tuple[float, float]
    value: float
    low: float
    high: float
    tip: str


@final
@dataclass(frozen=True)
class Axes:
    """What a panel of methods over levels has in common with its neighbours."""

    levels: Sequence[tuple[float, float]]
    labels: Sequence[str]
    """Of the levels."""
    below: str
    """What the levels are, with the unit."""
    beside: str
    """What the values are, with the unit."""
    low: float
    high: float
    ticks: Sequence[tuple[float, str]]
    ceiling: tuple[float, str] | None = None
    """A dashed line across, and its name."""
    zero: float | None = None
    """A plain line across."""
    place: Callable[[float], float] = field(default=lambda x: x)
    """From a value to where it stands between `low` and `high`."""

    def x(self, level: tuple[float, float], aside: float = 0.0) -> float:
        n = len(self.levels)
        return LEFT + (WIDTH - LEFT - RIGHT) * (self.levels.index(level) + 0.5 + aside) / n

    def y(self, value: float) -> float:
        share = (self.place(value) - self.low) / (self.high - self.low)
        return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - min(max(share, 0.0), 1.0))


Lines = Mapping[str, Sequence[Point]]
"""Method -> its points, sorted by level."""


def panel(title: str, axes: Axes, lines: Lines, looks: Mapping[str, tuple[int, Style]]) -> Panel:
    """Draw lines with bands; a method with one point has a bar instead.

    Args:
        looks: Method -> its number in the palette and its style.
    """
    drawn = [_scaffold(axes)]
    order = [method for method in looks if lines.get(method)]
    apart = min(DODGE, SPREAD / len(order)) if order else 0.0
    aside = {method: apart * (i - (len(order) - 1) / 2) for i, method in enumerate(order)}
    drawn += [_band(axes, lines[m], aside[m], looks[m][0]) for m in order]
    drawn += [_line(axes, lines[m], aside[m], *looks[m], m) for m in order]
    return Panel(title, Html("".join(drawn)))


class Entry(NamedTuple):
    """One of a legend."""

    drawing: Html
    """In a box 26 wide and 14 high."""
    name: str


def entries(looks: Mapping[str, tuple[int, Style]], ceiling: bool = False) -> list[Entry]:
    """One per method, and one for the ceiling."""
    line = tag("line", x1=0, x2=26, y1=7, y2=7, class_="ceiling")
    return [Entry(_sample(*look), method) for method, look in looks.items()] + [Entry(line, "oracle")] * ceiling


def patch(paint: str) -> Html:
    """A filled box for a legend."""
    return tag("rect", x=4, y=1, width=18, height=12, style=f"fill:{paint}")


def legend(made: Sequence[Entry]) -> Html:
    """As it stands in a page."""
    return tag("ul", *(tag("li", _boxed(one.drawing), one.name) for one in made), class_="legend")


def _boxed(drawing: Html) -> Html:
    return tag("svg", drawing, viewBox="0 0 26 14", class_="sample", aria_hidden="true")


def _sample(number: int, style: Style) -> Html:
    line = tag(
        "line", x1=0, x2=26, y1=7, y2=7, class_="line", style=_paint(number), stroke_dasharray=dash(style.dashes)
    )
    return joined([line, tag("path", d=marker(style.marker, 13, 7), class_="dot", style=_paint(number))])


def _scaffold(axes: Axes) -> str:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    said = []
    for value, label in axes.ticks:
        y = axes.y(value)
        said.append(f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
        said.append(f'<text x="{LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{html(label)}</text>')
    small = ' class="small"' if max(map(len, axes.labels), default=0) * len(axes.labels) > 40 else ""
    for level, label in zip(axes.levels, axes.labels, strict=True):
        said.append(f'<text{small} x="{axes.x(level):.1f}" y="{bottom + 15}" text-anchor="middle">{html(label)}</text>')
    middle = (TOP + bottom) / 2
    said.append(f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 8}" text-anchor="middle">{html(axes.below)}</text>')
    said.append(f'<text transform="translate(11 {middle}) rotate(-90)" text-anchor="middle">{html(axes.beside)}</text>')
    if axes.zero is not None:
        y = axes.y(axes.zero)
        said.append(f'<line class="zero" x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>')
    if axes.ceiling is not None:
        y, name = axes.y(axes.ceiling[0]), axes.ceiling[1]
        ends = f'x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"'
        said.append(f'<line class="ceiling" {ends}><title>{html(name)}</title></line>')
    return "".join(said)


def _band(axes: Axes, points: Sequence[Point], aside: float, number: int) -> str:
    if len(points) == 1:
        p = points[0]
        x = f"{axes.x(p.level, aside):.1f}"
        ends = f'x1="{x}" x2="{x}" y1="{axes.y(p.low):.1f}" y2="{axes.y(p.high):.1f}"'
        return f'<line class="bar" style="{_paint(number)}" {ends}/>'
    above = [f"{axes.x(p.level, aside):.1f} {axes.y(p.high):.1f}" for p in points]
    below = [f"{axes.x(p.level, aside):.1f} {axes.y(p.low):.1f}" for p in reversed(points)]
    return f'<path class="band" style="{_paint(number)}" d="M{"L".join(above + below)}Z"/>'


def _line(axes: Axes, points: Sequence[Point], aside: float, number: int, style: Style, method: str) -> str:
    at = [(axes.x(p.level, aside), axes.y(p.value)) for p in points]
    path = "L".join(f"{x:.1f} {y:.1f}" for x, y in at)
    dashes = f' stroke-dasharray="{dash(style.dashes)}"' if dash(style.dashes) else ""
    said = [f'<path class="line" style="{_paint(number)}" d="M{path}"{dashes}/>']
    for p, (x, y) in zip(points, at, strict=True):
        tip = f"<title>{html(f'{method}, {p.tip}')}</title>"
        said.append(f'<path class="dot" style="{_paint(number)}" d="{marker(style.marker, x, y)}">{tip}</path>')
    return "".join(said)


def _paint(number: int) -> str:
    return f"--c:var(--m{number})"
