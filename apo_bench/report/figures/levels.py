"""Success over level: panels by scenario, clearance and noise, and by relations and carelessness; a line per method."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.records.method import as_seen, knows_relations, knows_truth
from apo_bench.records.settings import RANGE
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Cell

CEILING = "#444444"
DODGE = 0.07
"""Methods stand this far from each other at one level, so that equal rates do not hide each other."""
BESIDE = 3
"""Panels in a line, if there is but one per scenario, clearance and noise."""
MANY = 3
"""With more methods than this in a panel, the numbers of trials are left to the table."""


class Row(NamedTuple):
    """What the panels of one scenario have in common, whatever the carelessness."""

    scenario: str
    clearance_mm: float | None
    """None stands for every one."""
    noise: str
    relations: str

    def holds(self, c: Cell) -> bool:
        """Whether a cell is drawn here: the oracle meets no noise, and it and `none` are not told any relations."""
        where = c.scenario == self.scenario and self.clearance_mm in (None, c.clearance_mm)
        noise = knows_truth(c.method) or c.noise == self.noise
        return where and noise and (not knows_relations(c.method) or c.relations == self.relations)

    def title(self, careless: float) -> str:
        """`stick_in_tower, careful human, 0.25 mm clearance`, and what is not as usual."""
        human = "careful human" if careless == 0 else f"carelessness {careless:g}"
        unusual = ["range finder" if self.noise == RANGE else f"{self.noise} noise"] * (self.noise != "isotropic")
        unusual += [f"relations {self.relations}"] * (self.relations != "given")
        clearance = "" if self.clearance_mm is None else f", {self.clearance_mm:g} mm clearance"
        first = f"{self.scenario}, {human}{clearance}"
        return "\n".join([first, ", ".join(unusual)]) if unusual else first


class Style(NamedTuple):
    """How the line of a method looks; told apart without colour too."""

    color: str
    marker: str
    dashes: Any


STYLES = {
    "none": Style("#D55E00", "o", "-"),
    "search": Style("#E7298A", "8", (0, (4, 1.5))),
    "contact": Style("#332288", "p", "-"),
    "paper": Style("#0072B2", "s", "-"),
    "paper-track": Style("#009E73", "D", "-"),
    "last-only": Style("#E69F00", "v", (0, (4, 1.5))),
    "no-history": Style("#CC79A7", "^", (0, (4, 1.5))),
    "no-disappeared": Style("#56B4E9", "P", (0, (4, 1.5))),
    "minimal": Style("#8C6BB1", "X", (0, (1, 1))),
    "snap": Style("#A6761D", "*", (0, (1, 1))),
    "least-squares": Style("#117733", "<", (0, (1, 1))),
    "settle": Style("#882255", ">", (0, (1, 1))),
    "penalty": Style("#88CCEE", "d", (0, (1, 1))),
}
OTHERS = (Style("#6B6B6B", "h", (0, (1, 1))), Style("#DDCC77", "H", (0, (1, 1))), Style("#000000", "1", (0, (1, 1))))


def draw(cells: Sequence[Cell], path: Path) -> None:
    """Write the figure as PNG; no display is needed."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    swept = [cell for cell in cells if not knows_truth(cell.method)]
    rows = rows_of(cells)
    careless = sorted({c.careless for c in swept}) or [0.0]
    lines = list(dict.fromkeys(row._replace(relations="given") for row in rows))
    columns = [(relations, f) for relations in dict.fromkeys(row.relations for row in rows) for f in careless]
    panels = [[(line._replace(relations=relations), f) for relations, f in columns] for line in lines]
    if len(columns) == 1:
        alone = [panel for line in panels for panel in line]
        panels = [alone[i : i + BESIDE] for i in range(0, len(alone), BESIDE)]
    width = max(map(len, panels))
    figure = Figure(figsize=(0.9 + 4.3 * width, 1.0 + 3.1 * len(panels)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(panels), width, squeeze=False, sharey=True)
    for i, across in enumerate(axes):
        for j, axis in enumerate(across):
            row, f = panels[i][j] if j < len(panels[i]) else (None, 0.0)
            if row not in rows:
                axis.set_axis_off()
                continue
            axis.set_title(row.title(f), fontsize=10)
            _panel(axis, [c for c in cells if row.holds(c)], f)
        across[0].set_ylabel("success")
    figure.supxlabel(level_axis(row.noise for row in rows), fontsize=10)
    legend(figure, axes, width)
    figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.15)


def legend(figure: Any, axes: Any, columns: int) -> None:
    """One legend for all panels, above them."""
    handles = {label: h for axis in axes.flat for h, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    many = min(4 * columns, max(1, len(handles)))
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=many, frameon=False)


def rows_of(cells: Sequence[Cell]) -> list[Row]:
    """What panels show, in the order of the cells; the cells of methods that meet everything decide."""
    keen = [c for c in cells if knows_relations(c.method)]
    fewer = keen or [c for c in cells if as_seen(c.method)] or list(cells)
    return list(dict.fromkeys(Row(c.scenario, c.clearance_mm, c.noise, c.relations) for c in fewer))


def _panel(axis: Any, cells: Sequence[Cell], careless: float) -> None:
    """One panel: levels side by side at equal distances, since they span two decades and zero."""
    here = [c for c in cells if not knows_truth(c.method) and c.careless == careless]
    levels = sorted({(c.level, c.level_deg) for c in here})
    place = {level: x for x, level in enumerate(levels)}
    for ceiling in (c for c in cells if c.method == "oracle" and c.rate is not None):
        axis.axhline(ceiling.rate, color=CEILING, linestyle="--", linewidth=1.2, label="oracle")
    methods = list(dict.fromkeys(c.method for c in here))
    for i, (method, style) in enumerate(styles(methods).items()):
        line = [c for c in here if c.method == method and c.rate is not None]
        aside = DODGE * (i - (len(methods) - 1) / 2)
        _line(axis, line, [place[c.level, c.level_deg] + aside for c in line], style, method)
        if len(methods) <= MANY:
            _counts(axis, line, [place[c.level, c.level_deg] + aside for c in line], style, i, len(methods))
    measured = bool(here) and here[0].noise == RANGE
    axis.set_xticks(range(len(levels)), [f"{mm:g}" if measured else level_label(mm, deg) for mm, deg in levels])
    axis.set_xlim(-0.4, max(len(levels) - 1, 0) + 0.4)
    axis.set_ylim(-0.04, 1.06)
    axis.yaxis.set_major_formatter(lambda y, _: f"{100 * y:.0f} %")
    axis.grid(axis="y", alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def styles(methods: Sequence[str]) -> dict[str, Style]:
    """One each; a method of one's own takes the next that is left."""
    own = [method for method in methods if method not in STYLES]
    return {m: STYLES[m] if m in STYLES else OTHERS[own.index(m) % len(OTHERS)] for m in methods}


def _line(axis: Any, cells: Sequence[Cell], x: Sequence[float], style: Style, method: str) -> None:
    rates = [float(c.rate or 0.0) for c in cells]
    below = [rate - c.interval.low for rate, c in zip(rates, cells, strict=True)]
    above = [c.interval.high - rate for rate, c in zip(rates, cells, strict=True)]
    bars = {"fmt": "none", "capsize": 2, "linewidth": 0.9, "alpha": 0.7}
    axis.errorbar(x, rates, yerr=[below, above], color=style.color, **bars)
    shape = {"color": style.color, "marker": style.marker, "linestyle": style.dashes}
    axis.plot(x, rates, markersize=5, linewidth=1.6, label=method, clip_on=False, **shape)


def _counts(axis: Any, cells: Sequence[Cell], x: Sequence[float], style: Style, i: int, methods: int) -> None:
    """`n=100` beside every point, of the first methods on the left, of the others on the right and apart in height."""
    side, align = (-6, "right") if i < methods // 2 else (6, "left")
    for at, cell in zip(x, cells, strict=True):
        rate = float(cell.rate or 0.0)
        away = (-12 - 7 * (i // 2)) if rate > 0.5 else (6 + 7 * (i // 2))
        text = {"textcoords": "offset points", "fontsize": 6, "color": style.color, "ha": align}
        axis.annotate(f"n={cell.trials}", (at, rate), (side, away), **text)


def level_axis(noises: Iterable[str]) -> str:
    """What a level is: of poses that are drawn, of rays of the range finder, or of both."""
    found = set(noises)
    if found == {RANGE}:
        return "level: standard deviation of a ray of the range finder [mm]"
    also = "; range finder: of a ray [mm]" if RANGE in found else ""
    return f"level: standard deviation of the seen poses [mm and degrees]{also}"
