"""Draw a figure of panels below one legend, and write it as SVG or PNG."""

import io
import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench.benchmark.report.figures.style import list_report_styles
from apo_bench.io import save_figure, write_file

_ACROSS = 3
"""Number of panels in a row."""
_WIDTH = 5.0  # width of a panel [inches]
_HEIGHT = 3.2
"""Height of a panel with its title [inches]."""
_LEFT = 0.75  # left of the axes of a panel [inches]
_BELOW = 0.6  # below them
_ABOVE = 0.45  # above them
_RIGHT = 0.15  # right of them
"""Margins around the axes of a panel [inches]."""
_HEAD = 0.45  # height of the figure's title
_LEGEND_LINE = 0.22
"""Height of a line of the legend [inches]."""
_LETTERS = 58
"""Most letters in a line of a panel's title."""
_NAMES = 130
"""Most letters in a line of the legend of a figure with three panels in a row; a sample counts as eight."""


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
    """A drawn figure."""

    title: str
    panels: int
    svg: str
    canvas: Any
    """The figure of matplotlib."""

    def write(self, path: Path) -> Path:
        """Write the figure as PNG if the path ends in `.png`, else as SVG; return the path."""
        if path.suffix == ".png":
            with list_report_styles(self.title):
                save_figure(self.canvas, path, dpi=110)
        else:
            write_file(path, self.svg)
        return path


def draw_figure(title: str, panels: Sequence[FigurePanel], legend: Mapping[str, Any]) -> Figure:
    """Draw panels in rows below a title and one legend.

    Args:
        legend: Name -> matplotlib artist that is its sample.
    """
    with list_report_styles(title), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a box replaces a letter that the font does not have
        from matplotlib import figure as mpl

        across = min(_ACROSS, len(panels))
        heights = [max(p.height for p in panels[i : i + across]) for i in range(0, len(panels), across)]  # of each row
        # of the legend
        columns = max(1, min(len(legend), across * _NAMES // 3 // (8 + max(map(len, legend), default=0))))
        head = _HEAD + _LEGEND_LINE * -(-len(legend) // columns)  # -(-a // b) rounds up
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
    # without the XML declaration, to be embedded in HTML
    return Figure(title, len(panels), svg[svg.index("<svg ") :], canvas)
