"""A picture of a relation graph, as Fig. 7: each part above the parts that support it, an arrow per contact."""

from collections.abc import Mapping
from graphlib import TopologicalSorter
from pathlib import Path
from statistics import fmean
from typing import Any

from apo_bench.assembly import ArcResiduals, Graph, Node
from apo_bench.io import save_figure, use_figure_style

_INK = "#222222"
_GONE = "#8A8A8A"  # contacts that disappeared, parts that moved on
_ALARM = "#C8102E"  # residuals above the allowed gap
_GROUND = "#E4E4E4"  # parts without a colour
_PALE = 0.75  # share of white in the colour of a part
_DASHES = (0, (4, 2.5))  # style of contacts that disappeared
_DASH_DOTS = (0, (9, 2, 1.5, 2))  # style of contacts about an axis
_ROW_IN = 1.2  # distance between rows
_COLUMN_IN = 1.6  # distance between columns
_BOX_IN = (1.3, 0.5)  # width and height of a box
_BEND = 0.4  # curvature of an arrow that skips a row, so that it does not cross the box between
_LABEL_AT = 0.4  # position of a label, as a share of the way from the upper to the lower box

Place = tuple[float, float]


def place_nodes(graph: Graph) -> dict[Node, Place]:
    """Return column and row of each node: one row above the highest node below it, near the mean column of those.

    Rows count from 0 at the bottom; columns are centred at 0.
    """
    below = {node: [arc.environment for arc in graph.arcs if arc.manipulated == node] for node in graph.nodes}
    sorter = TopologicalSorter(below)
    sorter.prepare()
    places: dict[Node, Place] = {}
    row = 0
    # each pass takes the nodes all of whose supports are placed already
    while sorter.is_active():
        ready = sorter.get_ready()
        nodes = sorted(ready, key=lambda n: (fmean([places[m][0] for m in below[n]] or [0.0]), graph.nodes.index(n)))
        places |= {node: (k - (len(nodes) - 1) / 2, float(row)) for k, node in enumerate(nodes)}
        sorter.done(*ready)
        row += 1
    return places


@use_figure_style({"svg.hashsalt": "apo-bench"})
def draw_graph(
    graph: Graph,
    path: Path,
    title: str,
    *,
    colors: Mapping[str, tuple[float, float, float]],
    residuals: ArcResiduals = (),
    gap_m: float = 0.0,
) -> None:
    """Write the picture in the format of the suffix of `path`.

    Args:
        colors: Part -> RGB in 0..1.
        residuals: Residual of each arc, [m], written on the arc; None where it is unknown.
        gap_m: Residuals above this are red.
    """
    from matplotlib.figure import Figure

    places = {node: (x * _COLUMN_IN, y * _ROW_IN) for node, (x, y) in place_nodes(graph).items()}
    width = 2 * max(abs(x) for x, _ in places.values()) + _COLUMN_IN + 0.5
    height = max(y for _, y in places.values()) + _BOX_IN[1] + 0.9
    figure = Figure(figsize=(max(width, 0.08 * len(title)), height), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-figure.get_figwidth() / 2, figure.get_figwidth() / 2), ylim=(-0.7, height - 0.7))
    axes.axis("off")
    figure.text(0.5, 0.99, title, ha="center", va="top", fontsize=10, color=_INK)
    legend = "dashed: disappeared; dash-dot: about an axis" + f"; red: above {gap_m * 1e3:g} mm" * any(residuals)
    figure.text(0.5, 0.01, legend, ha="center", va="bottom", fontsize=7.5, color=_GONE)
    for arc, residual in zip(graph.arcs, residuals or [None] * len(graph.arcs), strict=True):
        color = _INK if arc.lost is None else _GONE
        if residual is not None and residual > gap_m:
            color = _ALARM
        style = _DASHES if arc.lost is not None else _DASH_DOTS if arc.axial else "-"
        label = arc.name if residual is None else f"{arc.name}\n{residual * 1e3:.2f} mm"
        _draw_arrow(axes, places[arc.manipulated], places[arc.environment], color, style, label)
    for node in graph.nodes:
        face = [_PALE + (1 - _PALE) * c for c in colors[node.part]] if node.part in colors else _GROUND
        _draw_node(axes, node, places[node], face, graph.is_current(node))
    save_figure(figure, path, dpi=110)


def _draw_arrow(axes: Any, upper: Place, lower: Place, color: str, style: Any, label: str) -> None:
    """Draw an arrow from the bottom of the upper box to the top of the lower box, with a label."""
    (x, y), (u, v) = upper, lower
    y, v = y - _BOX_IN[1] / 2, v + _BOX_IN[1] / 2
    bend = _BEND if y - v > _ROW_IN else 0.0
    look = {"arrowstyle": "-|>", "color": color, "linestyle": style, "connectionstyle": f"arc3,rad={bend}"}
    axes.annotate("", (u, v), (x, y), arrowprops=look | {"shrinkA": 0, "shrinkB": 0}, zorder=1)
    # arc3 is a quadratic Bezier curve: at the share s it deviates by 2 s (1 - s) rad of its length from the chord
    s = _LABEL_AT
    aside = 2 * s * (1 - s) * bend
    at = (x + s * (u - x) - aside * (y - v), y + s * (v - y) - aside * (u - x))
    white = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    axes.text(*at, label, fontsize=8, color=color, ha="center", va="center", bbox=white, zorder=2)


def _draw_node(axes: Any, node: Node, at: Place, face: Any, stands: bool) -> None:
    """Draw a box with the part's name and ODL; dashed and white if the part has moved on from there."""
    # operations of an ODL count from 1 on the page
    terms = (f"T_{{{k + 1}}}{'^{-1}' if inverse else ''}" for k, inverse in node.odl)
    odl = "$" + (r"\,".join(terms) or "T_0") + "$"
    ink, line = (_INK, "-") if stands else (_GONE, _DASHES)
    box = {"boxstyle": "round,pad=0.4", "facecolor": face if stands else "white", "edgecolor": ink, "linestyle": line}
    words = f"{node.part}\n{odl}"
    axes.text(*at, words, ha="center", va="center", color=ink, fontsize=9.5, bbox=box, parse_math=True, zorder=4)
