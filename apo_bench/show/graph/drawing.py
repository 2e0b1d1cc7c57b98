"""The picture of a relation graph, as Fig. 7: parts with their ODLs, an arrow from each part to what it was put on."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from apo_bench.assembly import Arc, ArcResiduals, Graph, Node
from apo_bench.io import default_looks, save_figure
from apo_bench.show.graph.layout import GraphLayout, layout_graph

_INK = "#222222"
_GONE = "#8A8A8A"
_ALARM = "#C8102E"
_GROUND = "#E4E4E4"
_PALE = 0.75
"""How much white is in the colour of a part."""
_MARGIN = 0.15
_HEAD = 0.32
_FOOT = 0.3
"""Inches around the graph, and for the title above it and the words below it."""
_DASHES = (0, (4, 2.5))
_DASH_DOTS = (0, (9, 2, 1.5, 2))

_Colors = Mapping[str, tuple[float, float, float]]


@default_looks({"svg.hashsalt": "apo-bench"})
def draw_graph(
    graph: Graph,
    path: Path,
    *,
    title: str,
    residuals: ArcResiduals | None = None,
    gap_m: float = 0.0,
    colors: _Colors | None = None,
) -> None:
    """Write the picture as the suffix of `path` says; no display is needed.

    Args:
        residuals: Written on the arcs, in red if above `gap_m`.
        colors: Of parts, RGB in 0..1.
    """
    from matplotlib.figure import Figure

    measured = [None] * len(graph.arcs) if residuals is None else list(residuals)
    texts = [_label(arc, residual, residuals is not None) for arc, residual in zip(graph.arcs, measured, strict=True)]
    layout = layout_graph(graph, texts)
    words = _words(graph, residuals is not None, gap_m)
    width = max(layout.width, 0.078 * len(title), 0.06 * len(words)) + 2 * _MARGIN
    height = layout.height + 2 * _MARGIN + _HEAD + (_FOOT if words else 0.0)
    figure = Figure(figsize=(width, height), facecolor="white")
    axes = _canvas(figure, layout, width, height, bool(words))
    figure.text(0.5, 1 - (_MARGIN + 0.1) / height, title, ha="center", va="center", fontsize=10, color=_INK)
    figure.text(0.5, (_MARGIN + 0.02) / height, words, ha="center", va="center", fontsize=7.5, color=_GONE)
    for i, (arc, residual) in enumerate(zip(graph.arcs, measured, strict=True)):
        _arrow(axes, layout, i, arc, texts[i], residual is not None and residual > gap_m)
    for node in layout.boxes:
        _node(axes, layout, node, graph.stands(node), (colors or {}).get(node.part))
    save_figure(figure, path, dpi=110)


def _canvas(figure: Any, layout: GraphLayout, width: float, height: float, words: bool) -> Any:
    """Axes over the whole figure, in inches, the graph in the middle."""
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    left = (width - layout.width) / 2
    below = _MARGIN + (_FOOT if words else 0.0)
    axes.set(xlim=(-left, width - left), ylim=(-below, height - below))
    axes.axis("off")
    return axes


def _node(axes: Any, layout: GraphLayout, node: Node, stands: bool, color: tuple[float, float, float] | None) -> None:
    from matplotlib.patches import FancyBboxPatch

    box = layout.boxes[node]
    shade = 0.08
    corner = box.x - box.width / 2 + shade, box.y - box.height / 2 + shade
    axes.add_patch(
        FancyBboxPatch(
            corner,
            box.width - 2 * shade,
            box.height - 2 * shade,
            boxstyle=f"round,pad={shade}",
            facecolor=_pale(color) if stands else "white",
            edgecolor=_INK if stands else _GONE,
            linestyle="-" if stands else _DASHES,
            linewidth=1.1,
            zorder=3,
        )
    )
    ink = {"ha": "center", "va": "center", "color": _INK if stands else _GONE, "zorder": 4}
    axes.text(box.x, box.y + 0.1, node.part, fontsize=9.5, fontweight="bold", **ink)
    axes.text(box.x, box.y - 0.11, _formula(node), fontsize=9.5, parse_math=True, **ink)


def _arrow(axes: Any, layout: GraphLayout, i: int, arc: Arc, text: str, alarming: bool) -> None:
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path as Outline

    color = _ALARM if alarming else _INK if arc.lost is None else _GONE
    axes.add_patch(
        FancyArrowPatch(
            path=Outline(layout.routes[i]),
            arrowstyle="-|>,head_length=5,head_width=2.2",
            color=color,
            linewidth=1.1,
            linestyle=_DASHES if arc.lost is not None else _DASH_DOTS if arc.axial else "-",
            joinstyle="round",
            zorder=1,
        )
    )
    room = layout.labels[i]
    white = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    axes.text(
        room.x, room.y, text, fontsize=8, color=color, ha="center", va="center", linespacing=1.05, bbox=white, zorder=2
    )


def _label(arc: Arc, residual: float | None, measured: bool) -> str:
    size = "not seen" if residual is None else f"{residual * 1e3:.2f} mm"
    return f"{arc.name}\n{size}" if measured else arc.name


def _formula(node: Node) -> str:
    """The ODL as it is set in the paper."""
    terms = (f"T_{{{k + 1}}}{'^{-1}' if inverse else ''}" for k, inverse in node.odl)
    return "$" + (r"\,".join(terms) or "T_0") + "$"


def _words(graph: Graph, measured: bool, gap_m: float) -> str:
    """What dashes and colours mean, if there are any."""
    words = {
        "dashed: disappeared": any(arc.lost is not None for arc in graph.arcs),
        "dash-dot: about an axis": any(arc.axial and arc.lost is None for arc in graph.arcs),
        f"red: above {gap_m * 1e3:g} mm": measured,
    }
    return "; ".join(text for text, holds in words.items() if holds)


def _pale(color: tuple[float, float, float] | None) -> Any:
    return _GROUND if color is None else tuple(_PALE + (1 - _PALE) * c for c in color)
