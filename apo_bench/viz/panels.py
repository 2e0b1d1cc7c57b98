"""Draw pictures side by side in one figure, each with a title above and lines of text below."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from numpy.typing import NDArray

_LINE_PX = 21  # height of a line of text
_TITLE_PX = 52  # space above the pictures, for the common title and the title of each picture
Color = tuple[float, float, float]  # RGB in 0..1


class PanelLine(NamedTuple):
    """A line of text below a picture, with a coloured square before it unless `color` is None."""

    text: str
    color: Color | None = None


class Panel(NamedTuple):
    """A picture, (height, width, 3), with its title and the lines below it."""

    image: NDArray[Any]
    lines: Sequence[PanelLine]
    title: str = ""


def draw_panels(title: str, panels: Sequence[Panel]) -> Any:
    """Return a matplotlib figure of pictures of equal size; the units of its axes are pixels of the picture."""
    from matplotlib.figure import Figure

    height, width = panels[0].image.shape[:2]
    below = _LINE_PX * (max(len(panel.lines) for panel in panels) + 1)  # one spare line as a margin
    whole = height + below + _TITLE_PX
    share = 1 / len(panels)
    figure = Figure(figsize=(width * len(panels) / 100, whole / 100))  # in inches at 100 dpi
    figure.text(0.5, 1 - 15 / whole, title, ha="center", va="center", fontsize=12)
    for i, panel in enumerate(panels):
        axes = figure.add_axes((i * share, below / whole, share, height / whole))
        axes.imshow(panel.image)
        axes.axis("off")
        figure.text((i + 0.5) * share, 1 - 40 / whole, panel.title, ha="center", va="center", fontsize=11)
        for j, line in enumerate(panel.lines):
            y = (below - _LINE_PX * (j + 0.8)) / whole
            square = "white" if line.color is None else line.color
            figure.text((i + 0.02) * share, y, "\u25a0", color=square, fontsize=14, va="center")
            figure.text((i + 0.045) * share, y, line.text, va="center", fontsize=10)
    return figure
