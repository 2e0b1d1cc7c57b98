"""The picture of a relation graph, as Fig. 7: parts with their ODLs, an arrow from each part to what it was put on."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Arc, ArcResiduals, Graph, Node
from apo_bench.geometry import Array
from apo_bench.io import default_looks, save_figure
from apo_bench.viz.graph.layout import GraphLayout, RowItem, layout_graph

_INK = "#222222"
_GONE = "#8A8A8A"
_ALARM = "#C8102E"
_GROUND = "#E4E4E4"
_PALE = 0.75  # how much white is in the colour of a part
_DASHES = (0, (4, 2.5))
_DASH_DOTS = (0, (9, 2, 1.5, 2))
_BOX_IN = 0.5  # height of a box
_ROW_IN = 1.2  # from row to row
_GAP_IN = 0.35  # between the boxes of a row
_MARGIN_IN = 0.4  # around all boxes, with title and legend in it
_ALONG = 0.6  # where on its piece of the arrow a label stands
_LETTER_IN = 0.085  # width of a letter of a name
_TERM_IN = 0.25  # width of a term of an ODL

_Colors = Mapping[str, tuple[float, float, float]]
_Places = Mapping[RowItem, Array]


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
    layout = layout_graph(graph)
    box_in = max(max(_LETTER_IN * len(node.part), _TERM_IN * len(node.odl)) for node in graph.nodes) + 0.2
    places = {item: np.array([x * (box_in + _GAP_IN), layout.row[item] * _ROW_IN]) for item, x in layout.column.items()}
    wide_in = box_in + 2 * max(abs(x) for x, _ in places.values())
    figure, axes = _canvas(wide_in, max(y for _, y in places.values()), len(title))
    figure.text(0.5, 0.99, title, ha="center", va="top", fontsize=10, color=_INK)
    figure.text(0.5, 0.01, _legend(graph, residuals, gap_m), ha="center", va="bottom", fontsize=7.5, color=_GONE)
    for i, arc in enumerate(graph.arcs):
        residual = None if residuals is None else residuals[i]
        color = _ALARM if residual is not None and residual > gap_m else _INK if arc.lost is None else _GONE
        corners = _corners(layout, places, layout.routes[i])
        _draw_arrow(axes, corners, arc, color)
        _draw_label(axes, corners, arc.name if residuals is None else f"{arc.name}\n{_size(residual)}", color)
    for node in graph.nodes:
        face = _pale((colors or {}).get(node.part)) if graph.stands(node) else None
        _draw_node(axes, node, places[node], wide_in if node == layout.ground else box_in, face)
    save_figure(figure, path, dpi=110)


def _canvas(wide_in: float, high_in: float, letters: int) -> tuple[Any, Any]:
    """A figure, and axes over the whole of it in inches."""
    from matplotlib.figure import Figure

    half_in = max(wide_in, 0.08 * letters, 2.5) / 2 + 0.15
    figure = Figure(figsize=(2 * half_in, high_in + _BOX_IN + 2 * _MARGIN_IN), facecolor="white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    edge = _BOX_IN / 2 + _MARGIN_IN
    axes.set(xlim=(-half_in, half_in), ylim=(-edge, high_in + edge))
    axes.axis("off")
    return figure, axes


def _corners(layout: GraphLayout, places: _Places, route: tuple[RowItem, ...]) -> Array:
    """The corners of an arrow, (k, 2): from box to box past the rows between, upright to the ground."""
    half = np.array([0.0, _BOX_IN / 2])
    bends = [places[bend] + side * half for bend in route[1:-1] for side in (1, -1)]
    points = np.array([places[route[0]] - half, *bends, places[route[-1]] + half])
    if route[-1] == layout.ground:
        points[-1, 0] = points[-2, 0]
    return points


def _draw_arrow(axes: Any, corners: Array, arc: Arc, color: str) -> None:
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path as Outline

    line = _DASHES if arc.lost is not None else _DASH_DOTS if arc.axial else "-"
    head = "-|>,head_length=5,head_width=2.2"
    axes.add_patch(
        FancyArrowPatch(path=Outline(corners), arrowstyle=head, color=color, linewidth=1.1, linestyle=line, zorder=1)
    )


def _draw_label(axes: Any, corners: Array, text: str, color: str) -> None:
    """On the first piece of the arrow."""
    x, y = corners[0] + _ALONG * (corners[1] - corners[0])
    white = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"}
    axes.text(x, y, text, fontsize=8, color=color, ha="center", va="center", linespacing=1.05, bbox=white, zorder=2)


def _draw_node(axes: Any, node: Node, at: Array, width_in: float, face: Any) -> None:
    """A box with name and ODL; dashed and white where the part has left, which has no colour."""
    from matplotlib.patches import FancyBboxPatch

    ink, line = (_GONE, _DASHES) if face is None else (_INK, "-")
    pad = 0.08
    axes.add_patch(
        FancyBboxPatch(
            (at[0] - width_in / 2 + pad, at[1] - _BOX_IN / 2 + pad),
            width_in - 2 * pad,
            _BOX_IN - 2 * pad,
            boxstyle=f"round,pad={pad}",
            facecolor="white" if face is None else face,
            edgecolor=ink,
            linestyle=line,
            zorder=3,
        )
    )
    terms = (f"T_{{{k + 1}}}{'^{-1}' if inverse else ''}" for k, inverse in node.odl)
    odl = "$" + (r"\,".join(terms) or "T_0") + "$"
    words = {"ha": "center", "va": "center", "color": ink, "fontsize": 9.5, "zorder": 4}
    axes.text(at[0], at[1] + 0.1, node.part, fontweight="bold", **words)
    axes.text(at[0], at[1] - 0.11, odl, parse_math=True, **words)


def _pale(color: tuple[float, float, float] | None) -> Any:
    return _GROUND if color is None else [_PALE + (1 - _PALE) * c for c in color]


def _size(residual: float | None) -> str:
    return "not seen" if residual is None else f"{residual * 1e3:.2f} mm"


def _legend(graph: Graph, residuals: ArcResiduals | None, gap_m: float) -> str:
    """What dashes and colours mean, if there are any."""
    meanings = {
        "dashed: disappeared": any(arc.lost is not None for arc in graph.arcs),
        "dash-dot: about an axis": any(arc.axial and arc.lost is None for arc in graph.arcs),
        f"red: above {gap_m * 1e3:g} mm": residuals is not None,
    }
    return "; ".join(text for text, holds in meanings.items() if holds)
