"""A figure of panels below one legend, as SVG and PNG."""

import io
import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.benchmark.report.figures.style import report_looks
from apo_bench.io import save_figure, write_file

_ACROSS = 3
"""Panels in a line."""
_WIDTH = 5.0
_HEIGHT = 3.2
"""Of a panel with its title [inches]."""
_LEFT = 0.75
_BELOW = 0.6
_ABOVE = 0.45
_RIGHT = 0.15
"""Around the axes of a panel [inches]."""
_HEAD = 0.45
_LEGEND_LINE = 0.22
"""Above the panels: the title, and a line of the legend [inches]."""
_LETTERS = 58
"""Of a line of a panel's title."""
_NAMES = 130
"""Letters of a line of the legend, samples included."""


class FigurePanel(NamedTuple):
    """One drawing with its title."""

    title: str
    draw: Callable[[Any], None]
    """Draws into axes of matplotlib."""
    height: float = _HEIGHT
    left: float = _LEFT


@final
@dataclass(frozen=True)
class Figure:
    """A figure that was drawn."""

    title: str
    panels: int
    svg: str
    canvas: Any
    """Matplotlib's figure."""

    def write(self, path: Path) -> Path:
        """Write it as SVG, or as PNG by the ending."""
        if path.suffix == ".png":
            with report_looks(self.title):
                save_figure(self.canvas, path, dpi=110)
        else:
            write_file(path, self.svg)
        return path


def draw(title: str, panels: Sequence[FigurePanel], legend: Mapping[str, Any]) -> Figure:
    """Draw every panel.

    Args:
        legend: Name -> what makes a sample of it: a matplotlib artist.
    """
    with report_looks(title), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box stands for a letter that the font does not have
        from matplotlib import figure as mpl

        across = min(_ACROSS, len(panels))
        heights = [max(p.height for p in panels[i : i + across]) for i in range(0, len(panels), across)]
        columns = max(1, min(len(legend), across * _NAMES // 3 // (8 + max(map(len, legend), default=0))))
        head = _HEAD + _LEGEND_LINE * -(-len(legend) // columns)
        width = across * _WIDTH
        height = head + sum(heights)
        canvas = mpl.Figure(figsize=(width, height))
        canvas.text(0.2 / width, 1 - 0.3 / height, title, fontsize=13)
        canvas.legend(
            list(legend.values()), list(legend), loc="upper left", bbox_to_anchor=(0, 1 - 0.35 / height), ncols=columns
        )
        for i, panel in enumerate(panels):
            below = height - head - sum(heights[: i // across]) - panel.height
            size = (_WIDTH - panel.left - _RIGHT, panel.height - _ABOVE - _BELOW)
            corner = (i % across * _WIDTH + panel.left, below + _BELOW)
            axes = canvas.add_axes((corner[0] / width, corner[1] / height, size[0] / width, size[1] / height))
            axes.set_title("\n".join(textwrap.wrap(panel.title, _LETTERS)[:2]), x=(0.2 - panel.left) / size[0])
            panel.draw(axes)
        file = io.StringIO()
        canvas.savefig(file, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    svg = file.getvalue()
    return Figure(title, len(panels), svg[svg.index("<svg ") :], canvas)
